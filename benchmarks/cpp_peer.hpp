// GLSL's words for C++: enough to compile what layerfit prints, on numbers or on numbers with derivatives.
// LANES = 1: plain float, the compiler vectorises what it can. LANES = 16: that many pixels in one value, by hand (AVX-512, libmvec).

#include <algorithm>
#include <cmath>
#include <immintrin.h>
#include <type_traits>
#include <utility>

#define INLINE [[gnu::always_inline]] inline
#define LAMBDA __attribute__((always_inline))
#define ONE template <class A> INLINE auto
#define TWO template <class A, class B> INLINE auto

#if LANES == 1
using F = float;
INLINE float sqrt(float a) { return std::sqrt(a); }
INLINE F load(const float *at) { return *at; }
INLINE void store(float *at, F value) { *at = value; }
#else
typedef float F __attribute__((vector_size(64), aligned(4), may_alias));
extern "C" {
[[gnu::const]] F _ZGVeN16v_expf(F);
[[gnu::const]] F _ZGVeN16v_logf(F);
[[gnu::const]] F _ZGVeN16vv_powf(F, F);
}
INLINE F exp(F a) { return _ZGVeN16v_expf(a); }
INLINE F log(F a) { return _ZGVeN16v_logf(a); }
INLINE F pow(F a, float b) { return _ZGVeN16vv_powf(a, F{} + b); }
INLINE F sqrt(F a) { return (F)_mm512_sqrt_ps((__m512)a); }
INLINE F load(const float *at) { return *(const F *)at; }
INLINE void store(float *at, F value) { *(F *)at = value; }
INLINE float sqrt(float a) { return std::sqrt(a); }
#endif
INLINE float exp(float a) { return std::exp(a); }
INLINE float log(float a) { return std::log(a); }
INLINE float pow(float a, float b) { return std::pow(a, b); }

// A number with its derivatives along K directions.
template <int K, class S> struct Dual {
    S v, d[K];
};
ONE value(A a) { return a; }
template <int K, class S> INLINE S value(Dual<K, S> a) { return a.v; }
template <class A> constexpr int order = 0;
template <int K, class S> constexpr int order<Dual<K, S>> = K;
ONE slope(A a, int k) {
    if constexpr (order<A>) return a.d[k];
    else return 0.0f;
}
template <int K, class S, class D> INLINE auto each(S v, D derivative) {
    return [&]<int... k>(std::integer_sequence<int, k...>) LAMBDA {
        return Dual<K, S>{v, {derivative(k)...}};
    }(std::make_integer_sequence<int, K>{});
}
template <class A> concept Plain = std::is_same_v<A, float> || std::is_same_v<A, F>;
#define DUALS template <int K, Plain A, Plain B> INLINE auto
#define DUAL(left, right, sign, v, slope) \
    DUALS operator sign(left a, right b) { return each<K>(v, [&](int k) LAMBDA { return slope; }); }
#define X Dual<K, A>
#define Y Dual<K, B>
DUAL(X, Y, +, a.v + b.v, a.d[k] + b.d[k])
DUAL(X, B, +, a.v + b, a.d[k] + B{})
DUAL(A, Y, +, a + b.v, A{} + b.d[k])
DUAL(X, Y, -, a.v - b.v, a.d[k] - b.d[k])
DUAL(X, B, -, a.v - b, a.d[k] + B{})
DUAL(A, Y, -, a - b.v, A{} - b.d[k])
DUAL(X, Y, *, a.v * b.v, a.d[k] * b.v + a.v * b.d[k])
DUAL(X, B, *, a.v * b, a.d[k] * b)
DUAL(A, Y, *, a * b.v, a * b.d[k])
DUALS operator/(X a, Y b) {
    const auto inverse = 1.0f / b.v;
    const auto q = a.v * inverse;
    return each<K>(q, [&](int k) LAMBDA { return (a.d[k] - q * b.d[k]) * inverse; });
}
DUALS operator/(X a, B b) { return a * (1.0f / b); }
DUALS operator/(A a, Y b) {
    const auto inverse = 1.0f / b.v;
    const auto q = a * inverse, fall = -q * inverse;
    return each<K>(q, [&](int k) LAMBDA { return fall * b.d[k]; });
}
#undef X
#undef Y

// No branch: both values are there.
template <class R, class A> INLINE R as(A a) {
    if constexpr (std::is_same_v<R, A>) return a;
    else return R{} + a;
}
template <class C, class A, class B> INLINE auto select(C which, A yes, B no) {
    if constexpr (constexpr int K = std::max(order<A>, order<B>))
        return each<K>(select(which, value(yes), value(no)), [&](int k) LAMBDA { return select(which, slope(yes, k), slope(no, k)); });
    else {
        using R = decltype(yes + no);
        if constexpr (std::is_same_v<C, bool> || !std::is_same_v<R, float>) return which ? as<R>(yes) : as<R>(no);
        else return which ? F{} + yes : F{} + no;
    }
}
TWO max(A a, B b) { return select(value(a) > value(b), a, b); }
TWO min(A a, B b) { return select(value(a) < value(b), a, b); }
#define COMPARE(sign) \
    template <int K, class A, class B> INLINE auto operator sign(Dual<K, A> a, B b) { return a.v sign value(b); }
COMPARE(>) COMPARE(>=) COMPARE(<) COMPARE(==)

template <int K, class S, class D> INLINE auto chain(Dual<K, S> a, S v, D slope) {
    return each<K>(v, [&](int k) LAMBDA { return slope * a.d[k]; });
}
#define CHAIN template <int K, class S> INLINE auto
CHAIN sqrt(Dual<K, S> a) {
    const S root = sqrt(a.v);
    return chain(a, root, select(root > 1e-7f, 0.5f / root, 0.0f));
}
CHAIN exp(Dual<K, S> a) {
    const S e = exp(a.v);
    return chain(a, e, e);
}
CHAIN log(Dual<K, S> a) { return chain(a, log(a.v), 1.0f / a.v); }
CHAIN pow(Dual<K, S> a, float b) {
    const S p = pow(a.v, b);
    return chain(a, p, b * p / a.v);
}
CHAIN operator-(Dual<K, S> a) { return chain(a, -a.v, -1.0f); }
ONE abs(A a) { return select(value(a) < 0.0f, -a, a); }

template <class T> struct vec2 {
    T x, y;
    template <class A, class B> INLINE vec2(A x, B y) : x(as<T>(x)), y(as<T>(y)) {}
};
template <class A, class B> vec2(A, B) -> vec2<decltype(A() + B())>;
template <class T> struct vec3 {
    T x, y, z;
    template <class A, class B, class C> INLINE vec3(A x, B y, C z) : x(as<T>(x)), y(as<T>(y)), z(as<T>(z)) {}
    INLINE explicit vec3(T s) : x(s), y(s), z(s) {}
};
template <class A, class B, class C> vec3(A, B, C) -> vec3<decltype(A() + B() + C())>;
template <class T> struct vec4 {
    T x, y, z, w;
    template <class A, class B, class C, class D> INLINE vec4(A x, B y, C z, D w) : x(as<T>(x)), y(as<T>(y)), z(as<T>(z)), w(as<T>(w)) {}
};
template <class A, class B, class C, class D> vec4(A, B, C, D) -> vec4<decltype(A() + B() + C() + D())>;
template <class D, class... V> INLINE auto three(D f, V... v) {
    const auto x = f(v.x...);
    return vec3<std::remove_const_t<decltype(x)>>(x, f(v.y...), f(v.z...));
}
// Componentwise; a number stands for three of it.
#define COMPONENTS(name, expression) \
    TWO name(vec3<A> a, vec3<B> b) { return three([](auto a, auto b) LAMBDA { return expression; }, a, b); } \
    TWO name(vec3<A> a, B b) { return three([](auto a, auto b) LAMBDA { return expression; }, a, vec3<B>(b)); } \
    TWO name(A a, vec3<B> b) { return three([](auto a, auto b) LAMBDA { return expression; }, vec3<A>(a), b); }
COMPONENTS(operator+, a + b)
COMPONENTS(operator-, a - b)
COMPONENTS(operator*, a * b)
COMPONENTS(operator/, a / b)
COMPONENTS(max, max(a, b))
COMPONENTS(min, min(a, b))
ONE operator-(vec3<A> a) { return three([](auto a) LAMBDA { return -a; }, a); }
ONE exp(vec3<A> a) { return three([](auto a) LAMBDA { return exp(a); }, a); }
ONE sqrt(vec3<A> a) { return three([](auto a) LAMBDA { return sqrt(a); }, a); }
ONE abs(vec3<A> a) { return three([](auto a) LAMBDA { return abs(a); }, a); }
ONE inversesqrt(A x) { return 1.0f / sqrt(x); }
TWO dot(vec3<A> a, vec3<B> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
TWO lessThan(vec3<A> a, vec3<B> b) { return three([](auto a, auto b) LAMBDA { return value(a) < value(b); }, a, b); }
template <class A, class B, class C> INLINE auto mix(vec3<A> no, vec3<B> yes, vec3<C> which) {
    return three([](auto which, auto yes, auto no) LAMBDA { return select(which, yes, no); }, which, yes, no);
}
template <class C, class A, class B> INLINE auto select(C which, vec3<A> yes, vec3<B> no) {
    return three([which](auto yes, auto no) LAMBDA { return select(which, yes, no); }, yes, no);
}

// log(1 + x): both branches of the printed one.
ONE lf_log1p(A x) {
    const auto s = x / (2.0f + x), u = s * s;
    const auto near = 2.0f * s * (1.0f + u * (1.0f / 3 + u * (1.0f / 5 + u * (1.0f / 7 + u * (1.0f / 9 + u / 11.0f)))));
    return select(value(abs(x)) > 0.3f, log(1.0f + x), near);
}
ONE lf_log1p(vec3<A> x) { return three([](auto x) LAMBDA { return lf_log1p(x); }, x); }

#undef ONE
#undef TWO

// The numbers of a material in the order of its leaves; with derivatives, all of one direction after those of the one before.
struct Values {
    const float *at;
    INLINE float one() { return *at++; }
};
template <int K> struct Tangents {
    const float *at;
    int count;
    INLINE auto one() {
        ++at;
        return each<K>(at[-1], [this](int k) { return at[(k + 1) * count - 1]; });
    }
};
