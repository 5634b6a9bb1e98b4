#version 330 core
// precise, two coats: Coat over Coat over Conductor.
// Printed by layerfit 0.1.0 from its precise form.
// Left out, because this material does without: coat: anisotropy, primer: anisotropy, base: anisotropy.
// Indices of refraction are relative to the layer above: its own index divides those in the preset.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    float eta;    // index of refraction, against air
    vec3 tau;     // optical depth, one way at normal incidence
};

struct Interface {
    float tilt;        // turn of the mean facet towards a grazing direction
    float gain;        // part of the reflected light that a second facet lets in
    vec4 passed;       // energy that passes, beyond the closed form: four coefficients
    vec4 passed_high;  // the other four, of higher powers
    vec4 bend;         // sine of the refracted light over that at a smooth interface
    vec4 bend_high;    // 
    vec4 spread;       // width of a lobe seen through it
    vec4 spread_high;  // 
    vec4 path;         // mean path over that of the refracted direction
    vec4 path_high;    // 
    vec4 theta;        // scale of the path's distribution
    vec4 theta_high;   // 
};

struct Curve {
    vec3 c0;  // coefficients of the powers of the curves' argument
    vec3 c1;  // 
    vec3 c2;  // 
    vec3 c3;  // 
    vec3 c4;  // 
    vec3 c5;  // 
    vec3 c6;  // 
    vec3 c7;  // 
};

struct Conductor {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
};

struct Crossing {
    vec4 w;       // median direction
    float T;      // energy that passes
    float a;      // spread, as a width
    float path;   // mean path, in thicknesses
    float theta;  // scale of the path's distribution
    float s;      // argument of the baked curves
};

const Coat lf_coat = Coat(
    0.1,                   // alpha: width of the facet slopes; the square of an artist's roughness
    1.5,                   // eta: index of refraction, against air
    vec3(0.05, 0.2, 0.6)   // tau: optical depth, one way at normal incidence
);

const Coat lf_primer = Coat(
    0.25,                 // alpha: width of the facet slopes; the square of an artist's roughness
    1.1999999,            // eta: index of refraction, against air
    vec3(0.3, 0.1, 0.2)   // tau: optical depth, one way at normal incidence
);

const Interface lf_coat_top = Interface(
    0.024779005,                                                  // tilt: turn of the mean facet towards a grazing direction
    0.036722906,                                                  // gain: part of the reflected light that a second facet lets in
    vec4(-0.022298388, 0.03387798, -0.0103099225, -0.013259102),  // passed: energy that passes, beyond the closed form: four coefficients
    vec4(0.028962415, -0.021387354, -0.01196556, 0.014177172),    // passed_high: the other four, of higher powers
    vec4(1.0287149, -0.05618003, 0.06226027, -0.05720377),        // bend: sine of the refracted light over that at a smooth interface
    vec4(0.041371346, 0.003288269, -0.03387451, 0.016711235),     // bend_high: 
    vec4(0.6110438, -0.30916816, 0.19031203, -0.31476402),        // spread: width of a lobe seen through it
    vec4(0.14646864, 0.20258307, -0.14906263, -0.01018548),       // spread_high: 
    vec4(1.0417676, -0.09941718, 0.13050604, -0.13191032),        // path: mean path over that of the refracted direction
    vec4(0.031531334, 0.0896492, -0.051778316, -0.0077610016),    // path_high: 
    vec4(0.08719435, -0.22555345, 0.33561954, -0.21172841),       // theta: scale of the path's distribution
    vec4(-0.014265373, -0.082942754, -0.03109099, 0.18081078)     // theta_high: 
);

const Interface lf_coat_both = Interface(
    0.024779005,                                                  // tilt: turn of the mean facet towards a grazing direction
    0.036722906,                                                  // gain: part of the reflected light that a second facet lets in
    vec4(-0.022298388, 0.03387798, -0.0103099225, -0.013259102),  // passed: energy that passes, beyond the closed form: four coefficients
    vec4(0.028962415, -0.021387354, -0.01196556, 0.014177172),    // passed_high: the other four, of higher powers
    vec4(0.8740273, -0.052167535, 0.051979005, -0.050500393),     // bend: sine of the refracted light over that at a smooth interface
    vec4(0.038603067, 0.0008864403, -0.03025961, 0.015664577),    // bend_high: 
    vec4(0.08601386, -0.025296396, 0.011873268, -0.024669722),    // spread: width of a lobe seen through it
    vec4(0.013517067, 0.012449205, -0.012207478, 0.0010761321),   // spread_high: 
    vec4(1.0279282, -0.044994652, 0.050734162, -0.05081415),      // path: mean path over that of the refracted direction
    vec4(-0.010020494, 0.06349468, -0.011087894, -0.020304203),   // path_high: 
    vec4(0.029751584, -0.0662639, 0.10902027, -0.075114295),      // theta: scale of the path's distribution
    vec4(-0.063635595, 0.067949235, 0.014836162, 0.005317107)     // theta_high: 
);

const Curve lf_coat_passed = Curve(
    vec3(0.98590416, 0.98274827, 0.9786481),            // c0: coefficients of the powers of the curves' argument
    vec3(-0.008991003, -0.0015498996, 0.0073432326),    // c1: 
    vec3(0.0045963526, 0.0022250414, 0.00077331066),    // c2: 
    vec3(0.019406796, 0.015256643, 0.008446455),        // c3: 
    vec3(0.0017943382, -0.0030956268, -0.0067255497),   // c4: 
    vec3(-0.017215729, -0.0086221695, -0.00020313263),  // c5: 
    vec3(-0.0032730103, -0.00019955635, 0.0024578571),  // c6: 
    vec3(0.0069413185, 0.0022859573, -0.001868248)      // c7: 
);

const Curve lf_coat_inner_again = Curve(
    vec3(0.36035553, 0.18331626, 0.04803365),         // c0: coefficients of the powers of the curves' argument
    vec3(-0.13232316, -0.045524586, -0.0070955837),   // c1: 
    vec3(-0.034575596, -0.023965627, -0.005745411),   // c2: 
    vec3(-0.18139237, -0.06928861, -0.018667795),     // c3: 
    vec3(0.028492987, 0.014148682, 0.0033291504),     // c4: 
    vec3(0.28883004, 0.079076886, 0.026420683),       // c5: 
    vec3(-0.008797705, -0.0046216547, -0.003297791),  // c6: 
    vec3(-0.1482085, -0.038752258, -0.014876187)      // c7: 
);

const Curve lf_coat_inner_rest = Curve(
    vec3(0.087790474, 0.07042574, 0.045924775),         // c0: coefficients of the powers of the curves' argument
    vec3(-0.02835534, -0.01922483, -0.010248066),       // c1: 
    vec3(-0.011888631, -0.00852045, -0.005970752),      // c2: 
    vec3(-0.022531852, -0.013223067, -0.01009953),      // c3: 
    vec3(0.016208053, 0.0052274615, 0.0011859313),      // c4: 
    vec3(0.021609515, 0.0026581287, 0.006765574),       // c5: 
    vec3(-0.0061142594, -0.00038327277, 0.0004287958),  // c6: 
    vec3(-0.006678909, 0.0027749538, -0.0015668869)     // c7: 
);

const Conductor lf_base = Conductor(
    0.25,                                     // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(0.11166667, 0.5133334, 0.61222225),  // eta: index of refraction, real part
    vec3(2.173889, 1.3627778, 1.19)           // k: index of refraction, imaginary part
);

const Curve lf_coat_again = Curve(
    vec3(0.10702271, 0.18307614, 0.08630123),           // c0: coefficients of the powers of the curves' argument
    vec3(-0.007968048, -0.020511333, -0.01219501),      // c1: 
    vec3(0.00070624053, -0.0061041564, -0.0032450035),  // c2: 
    vec3(0.0043961406, 0.012475193, -0.002338171),      // c3: 
    vec3(-0.027675599, -0.023697019, -0.010627672),     // c4: 
    vec3(-0.04561591, -0.081035495, -0.021730304),      // c5: 
    vec3(0.017712146, 0.01457122, 0.0063140094),        // c6: 
    vec3(0.034206867, 0.056613088, 0.016384244)         // c7: 
);

const Curve lf_coat_rest = Curve(
    vec3(0.47436747, 0.36414498, 0.23059379),          // c0: coefficients of the powers of the curves' argument
    vec3(-0.030093208, -0.031955607, -0.029816736),    // c1: 
    vec3(-0.010827452, -0.0049446225, -0.0026966631),  // c2: 
    vec3(0.13356602, 0.05502546, 0.006746471),         // c3: 
    vec3(-0.024067163, -0.032443047, -0.021829665),    // c4: 
    vec3(-0.3667345, -0.18902922, -0.05388701),        // c5: 
    vec3(0.0031433105, 0.023648977, 0.013657093),      // c6: 
    vec3(0.21675205, 0.1236186, 0.03609693)            // c7: 
);

// log(1 + x) without the cancellation near 0.
float lf_log1p(float x) {
    float s = x / (2.0 + x);
    float u = s * s;
    float near = 2.0 * s * (1.0 + u * (1.0 / 3.0 + u * (1.0 / 5.0 + u * (1.0 / 7.0 + u * (1.0 / 9.0 + u / 11.0)))));
    float far = log(1.0 + x);
    return abs(x) > 0.3 ? far : near;
}

vec3 lf_log1p(vec3 x) {
    return vec3(lf_log1p(x.x), lf_log1p(x.y), lf_log1p(x.z));
}

// The cosine between either direction and their half vector.
float lf_half_cosine(vec4 wi, vec4 wo) {
    vec4 s = wi + wo;
    float s2 = max(dot(s, s), 1e-20);
    return min(0.5 * sqrt(s2), 1.0);
}

// Exact reflectance of a dielectric boundary (Born and Wolf 1999, 1.5.2); 1 under total internal reflection.
float lf_fresnel_dielectric(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g2 = delta + c * c;
    float g = sqrt(g2);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float rs = delta * (perpendicular * perpendicular);
    float rp = delta * ((eta2 + 1.0) * (c * c) - 1.0) * (parallel * parallel);
    float reflectance = 0.5 * (rs * rs + rp * rp);
    return reflectance;
}

// The unit vector halfway between two directions on the same side of the surface.
vec4 lf_half_vector(vec4 wi, vec4 wo) {
    vec4 s = wi + wo;
    return s * inversesqrt(max(dot(s, s), 1e-20));
}

// GGX density of facet normals (Walter et al. 2007, eq. 33).
float lf_ggx_d(vec4 h, float alpha) {
    float root = alpha / (dot(h.xyz, h.xyz) + alpha * alpha * (h.w * h.w));
    return root * root * 0.31830987;
}

// NoW (1 + 2 Lambda) of the GGX distribution (Heitz 2014, eq. 72, multiplied out).
float lf_ggx_projection(vec4 w, float alpha) {
    float a2 = alpha * alpha;
    return sqrt(a2 + (1.0 - a2) * (w.w * w.w));
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / max(NoV * projection_l + NoL * projection_v, 1e-14);
}

// Argument of the baked curves: sqrt(NoW) from the first node of the tables to 1, as -1 to 1.
float lf_grazing(float NoW) {
    return max(2.0 * (sqrt(NoW) - 0.16179292) / 0.83820707 - 1.0, -1.0);
}

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(vec4 w, float tilt) {
    return sqrt(tilt + (1.0 - tilt) * (w.w * w.w));
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric(float c, float eta) {
    float g = sqrt((eta - 1.0) * (eta + 1.0) + c * c);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float passed = 2.0 * (c * g) * (perpendicular * perpendicular + eta2 * (parallel * parallel));
    return passed;
}

// Energy that passes a rough interface, from what passes the mean facet; `gain` is `second_facet`.
float lf_with_second_facet(float T, float gain) {
    return T + (1.0 - T) * gain;
}

// A polynomial of eight coefficients at s.
float lf_curve(vec4 low, vec4 high, float s) {
    float upper = high.x + s * (high.y + s * (high.z + s * high.w));
    return low.x + s * (low.y + s * (low.z + s * (low.w + s * upper)));
}

// Follow one direction through the coat's rough top.
Crossing lf_pass_interface(Interface interface_, float eta, float alpha, vec4 w) {
    float s = lf_grazing(w.w);
    float T = lf_with_second_facet(lf_transmittance_dielectric(lf_facet_cosine(w, interface_.tilt), eta), interface_.gain);
    T = max(T + lf_curve(interface_.passed, interface_.passed_high, s), 0.0);
    T = min(T, 1.0);
    float bend = lf_curve(interface_.bend, interface_.bend_high, s) / eta;
    float sine = sqrt(dot(w.xyz, w.xyz));
    bend = min(bend, 0.9998 / max(sine, 1e-06));
    sine = sine * bend;
    float z = sqrt(max((1.0 - sine) * (1.0 + sine), 0.0));
    float a = max(lf_curve(interface_.spread, interface_.spread_high, s), 0.0) * alpha;
    float path = max(lf_curve(interface_.path, interface_.path_high, s), 1.0) / z;
    float theta = max(lf_curve(interface_.theta, interface_.theta_high, s), 1e-04);
    return Crossing(vec4(w.xyz * bend, z), T, a, path, theta, s);
}

// 0 where the indices match and there is no interface, 1 from the first index of the tables on.
float lf_presence(float eta) {
    return 2.0 - 1.0;
}

// The polynomial at s; an energy is never below 0.
vec3 lf_amount(Curve curve, float s) {
    vec3 upper = curve.c4 + s * (curve.c5 + s * (curve.c6 + s * curve.c7));
    return curve.c0 + s * (curve.c1 + s * (curve.c2 + s * (curve.c3 + s * upper)));
}

// Part of a lobe's width, as a power, that is due to the base.
float lf_base_share(Crossing i, Crossing o, float alpha) {
    float base = pow(max(alpha * (i.w.w + o.w.w), 1e-30), 1.412);
    return base / (base + pow(max(i.a, 1e-30), 1.412) + pow(max(o.a, 1e-30), 1.412));
}

// Part of the path's spread that counts, by the base's share of the width.
float lf_direct(float share, float d, float c, float e) {
    return min(max(d + c * pow(max(share, 1e-30), e), 0.0), 1.5);
}

// The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone.
vec4 lf_lean(Crossing x, Crossing i, Crossing o, float alpha) {
    float own = pow(max(x.a, 1e-30), 1.412);
    float total = pow(max(alpha * (i.w.w + o.w.w), 1e-30), 1.412) + pow(max(i.a, 1e-30), 1.412) + pow(max(o.a, 1e-30), 1.412);
    float turn = 0.7504 * own / total;
    vec3 y = x.w.xyz - turn * (i.w.xyz + o.w.xyz);
    float sine = sqrt(dot(y, y));
    float held = min(1.0, 0.9998 / max(sine, 1e-06));
    sine = min(sine, 0.9998);
    return vec4(y * held, sqrt((1.0 - sine) * (1.0 + sine)));
}

// A direction below a smooth boundary, as it is above it; `eta` is the index below over that above.
vec4 lf_upwards(vec4 w, float eta) {
    vec3 part = eta * w.xyz;
    float sine = sqrt(dot(part, part));
    float held = min(1.0, 0.9998 / max(sine, 1e-06));
    sine = min(sine, 0.9998);
    return vec4(part * held, sqrt((1.0 - sine) * (1.0 + sine)));
}

// Mean path of light that the base sends on: between that of one direction and that of all that cross.
float lf_between(vec4 y, Crossing x, float part) {
    float straight = 1.0 / y.w;
    return straight + part * (x.path - straight);
}

// Mean of exp(-tau u) over paths u = 1 + Gamma of mean `path` and scale theta.
vec3 lf_absorbed(float path, float theta, vec3 tau) {
    float scale = max(theta, 1e-06);
    return exp(-(tau + max(path - 1.0, 1e-09) * (lf_log1p(scale * tau) / scale)));
}

// Mean of u among the paths that are left: sum of u exp(-tau u) over that of exp(-tau u).
vec3 lf_projected(float path, float theta, vec3 tau) {
    return 1.0 + max(path - 1.0, 1e-09) / (1.0 + max(theta, 1e-06) * tau);
}

// The cosine between either direction and their half vector.
float lf_half_cosine2(vec4 wi, vec4 wo) {
    vec4 s = wi + wo;
    float s2 = dot(s, s);
    return min(0.5 * sqrt(s2), 1.0);
}

// Lambda of the GGX distribution (Heitz 2014, eq. 72).
float lf_smith_lambda(vec4 w, float alpha) {
    float tan2 = dot(w.xyz, w.xyz) / (w.w * w.w);
    float x = alpha * alpha * tan2;
    return 0.5 * x / (1.0 + sqrt(1.0 + x));
}

// D G / 4 of a base of width alpha, seen through the interface twice; `masked` is the width that shadows itself.
float lf_lobe(Crossing i, Crossing o, vec4 yi, vec4 yo, float alpha, float masked) {
    float M = yi.w + yo.w;
    float M2 = M * M;
    float spread = pow(max(i.a, 1e-30), 1.412) + pow(max(o.a, 1e-30), 1.412);
    float width2 = pow(pow(alpha * M, 1.412) + spread, 1.4164306);
    float own2 = alpha * alpha * M2 + 0.5566 * (i.a * i.a + o.a * o.a);
    float r = 1.0 + 0.3271 * (width2 / own2 - 1.0);
    r = min(r, 4.0);
    float log_r = log(r);
    float b = 2.0 - log_r * (1.993 + log_r * (0.197 + 0.051 * log_r));
    vec3 t = i.w.xyz + o.w.xyz;
    float v = dot(t, t) / width2;
    vec3 Y = yi.xyz + yo.xyz;
    float tilt = 1.0 + dot(Y, Y) / M2;
    float G = 1.0 / (1.0 + lf_smith_lambda(yi, masked) + lf_smith_lambda(yo, masked));
    return M2 * tilt * tilt * (0.25 * G) / (3.1415927 * width2 * (1.0 + v * (b + r * v)));
}

// The polynomial at s; an energy is never below 0.
vec3 lf_amount2(Curve curve, float s) {
    vec3 upper = curve.c4 + s * (curve.c5 + s * (curve.c6 + s * curve.c7));
    return max(curve.c0 + s * (curve.c1 + s * (curve.c2 + s * (curve.c3 + s * upper))), 0.0);
}

// Width of the lobe of light that met a base of width alpha twice, and the coat in between.
float lf_wider(float alpha, float coat_alpha) {
    return pow(2.0 * pow(alpha, 1.412) + 0.5751 * pow(coat_alpha, 1.412), 0.7082153);
}

// What is left of the direction in light that went to and fro, over pi: more goes on than back, the smoother the base.
float lf_ahead(Crossing i, Crossing o, float eta, float alpha) {
    float back = eta * eta * dot(i.w.xyz, o.w.xyz);
    return max(1.0 - (1.0 - alpha) * back, 0.0) / 3.1415927;
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor(float c, vec3 eta, vec3 k) {
    float c2 = c * c;
    float s2 = 1.0 - c2;
    vec3 p = (eta - k) * (eta + k) - s2;
    vec3 nk = eta * k;
    vec3 q = sqrt(p * p + 4.0 * nk * nk);
    vec3 larger = sqrt(0.5 * (q + (-p)));
    vec3 a = nk / larger;
    vec3 twice_ac = 2.0 * a * c;
    vec3 even = q * c2 + s2 * s2;
    vec3 odd = twice_ac * s2;
    return (q + c2 - twice_ac) * even / ((q + c2 + twice_ac) * (even + odd));
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(vec4 wi, vec4 wo) {
    bool lit = min(wi.w, wo.w) > 0.0;
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_coat.eta);
    float D = lf_ggx_d(lf_half_vector(wi, wo), lf_coat.alpha);
    float projection_i = lf_ggx_projection(wi, lf_coat.alpha);
    float projection_o = lf_ggx_projection(wo, lf_coat.alpha);
    float V = lf_v_smith(wi.w, wo.w, projection_i, projection_o);
    Crossing crossing = lf_pass_interface(lf_coat_top, lf_coat.eta, lf_coat.alpha, wi);
    Crossing crossing2 = lf_pass_interface(lf_coat_top, lf_coat.eta, lf_coat.alpha, wo);
    Crossing crossing3 = lf_pass_interface(lf_coat_both, lf_coat.eta, 1.0, wi);
    Crossing crossing4 = lf_pass_interface(lf_coat_both, lf_coat.eta, 1.0, wo);
    float there = lf_presence(lf_primer.eta);
    float alpha = lf_coat.alpha + there * (lf_primer.alpha - lf_coat.alpha);
    float eta = lf_coat.eta * lf_primer.eta;
    vec3 kept = lf_amount(lf_coat_passed, crossing3.s) * lf_amount(lf_coat_passed, crossing4.s);
    float part = lf_direct(lf_base_share(crossing3, crossing4, lf_base.alpha), 0.3296, 0.3522, 1.803);
    vec4 y = lf_upwards(lf_lean(crossing3, crossing3, crossing4, lf_base.alpha), lf_primer.eta);
    vec3 left = lf_absorbed(lf_between(y, crossing, part), part * crossing.theta, lf_coat.tau);
    y = lf_upwards(lf_lean(crossing4, crossing3, crossing4, lf_base.alpha), lf_primer.eta);
    left = left * lf_absorbed(lf_between(y, crossing2, part), part * crossing2.theta, lf_coat.tau);
    kept = kept * left;
    float throughput = crossing.T * crossing2.T / (lf_coat.eta * lf_coat.eta);
    float share = lf_base_share(crossing, crossing2, lf_primer.alpha);
    vec4 yi = lf_lean(crossing, crossing, crossing2, lf_primer.alpha);
    vec4 yo = lf_lean(crossing2, crossing, crossing2, lf_primer.alpha);
    part = lf_direct(share, 0.3296, 0.3522, 1.803);
    vec3 A = lf_absorbed(lf_between(yi, crossing, part), part * crossing.theta, lf_coat.tau);
    part = lf_direct(share, 0.3096, 0.2662, 1.772);
    float path = lf_between(yi, crossing, part);
    vec3 U = lf_projected(path, part * crossing.theta, lf_coat.tau);
    part = lf_direct(share, 0.3296, 0.3522, 1.803);
    A = A * lf_absorbed(lf_between(yo, crossing2, part), part * crossing2.theta, lf_coat.tau);
    part = lf_direct(share, 0.3096, 0.2662, 1.772);
    path = lf_between(yo, crossing2, part);
    U = U * lf_projected(path, part * crossing2.theta, lf_coat.tau);
    float F2 = lf_fresnel_dielectric(lf_half_cosine2(yi, yo), lf_primer.eta);
    float rise = 1.0 + 0.3036 * lf_presence(lf_coat.eta) * lf_coat.alpha * lf_coat.alpha * share;
    float lobes = rise * lf_lobe(crossing, crossing2, yi, yo, lf_primer.alpha, lf_primer.alpha);
    vec3 again = 0.5 * F2 * (lf_amount2(lf_coat_inner_again, crossing.s) + lf_amount2(lf_coat_inner_again, crossing2.s));
    vec3 lobes2 = lobes + again * lf_lobe(crossing, crossing2, yi, yo, lf_wider(lf_primer.alpha, lf_coat.alpha), lf_primer.alpha);
    vec3 root = lf_amount2(lf_coat_inner_rest, crossing.s) * lf_amount2(lf_coat_inner_rest, crossing2.s);
    vec3 rest = root * root * lf_ahead(crossing, crossing2, lf_coat.eta, lf_primer.alpha);
    float throughput2 = crossing3.T * crossing4.T / (eta * eta);
    share = lf_base_share(crossing3, crossing4, lf_base.alpha);
    yi = lf_lean(crossing3, crossing3, crossing4, lf_base.alpha);
    yo = lf_lean(crossing4, crossing3, crossing4, lf_base.alpha);
    part = lf_direct(share, 0.3296, 0.3522, 1.803);
    vec3 A2 = lf_absorbed(lf_between(yi, crossing3, part), part * crossing3.theta, lf_primer.tau);
    part = lf_direct(share, 0.3096, 0.2662, 1.772);
    path = lf_between(yi, crossing3, part);
    vec3 U2 = lf_projected(path, part * crossing3.theta, lf_primer.tau);
    part = lf_direct(share, 0.3296, 0.3522, 1.803);
    A2 = A2 * lf_absorbed(lf_between(yo, crossing4, part), part * crossing4.theta, lf_primer.tau);
    part = lf_direct(share, 0.3096, 0.2662, 1.772);
    path = lf_between(yo, crossing4, part);
    U2 = U2 * lf_projected(path, part * crossing4.theta, lf_primer.tau);
    vec3 F3 = lf_fresnel_conductor(lf_half_cosine2(yi, yo), lf_base.eta, lf_base.k);
    rise = 1.0 + 0.3036 * lf_presence(eta) * alpha * alpha * share;
    lobes = rise * lf_lobe(crossing3, crossing4, yi, yo, lf_base.alpha, lf_base.alpha);
    again = 0.5 * F3 * (lf_amount2(lf_coat_again, crossing3.s) + lf_amount2(lf_coat_again, crossing4.s));
    vec3 lobes3 = lobes + again * lf_lobe(crossing3, crossing4, yi, yo, lf_wider(lf_base.alpha, alpha), lf_base.alpha);
    root = lf_amount2(lf_coat_rest, crossing3.s) * lf_amount2(lf_coat_rest, crossing4.s);
    vec3 rest2 = root * root * lf_ahead(crossing3, crossing4, eta, lf_base.alpha);
    vec3 value = F * D * V + (throughput * A * (F2 * U * lobes2 + rest) + kept * (throughput2 * A2 * (F3 * U2 * lobes3 + rest2)));
    return lit ? value : vec3(0.0);
}

// BRDF [1/sr] in any frame: an isotropic surface asks for no tangent.
vec3 lf_brdf(vec3 n, vec3 v, vec3 l) {
    float NoL = dot(n, l);
    float NoV = dot(n, v);
    return lf_evaluate(vec4(l - NoL * n, NoL), vec4(v - NoV * n, NoV));
}

#ifndef LF_LIBRARY

#ifndef LF_LIGHTS
#define LF_LIGHTS 1
#endif

in vec3 v_position;  // this, u_eye and u_light in one space, such as the world's
in vec3 v_normal;
out vec4 color;

uniform vec3 u_eye;
uniform vec4 u_light[LF_LIGHTS];      // w = 0: direction to a distant light; w = 1: position of a point light
uniform vec3 u_light_rgb[LF_LIGHTS];  // its irradiance; its intensity per steradian

// Unit direction l to a light and the irradiance on a surface that faces it.
vec3 lf_light(vec4 light, vec3 rgb, vec3 position, out vec3 l) {
    vec3 away = light.xyz - position * light.w;
    float distance2 = dot(away, away);
    l = away * inversesqrt(distance2);
    return rgb / (light.w > 0.0 ? distance2 : 1.0);
}

// Linear radiance, or sRGB (IEC 61966-2-1) for a screen when LF_SRGB is defined.
vec3 lf_output(vec3 radiance) {
#ifdef LF_SRGB
    vec3 x = clamp(radiance, 0.0, 1.0);
    return mix(12.92 * x, 1.055 * pow(max(x, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055, greaterThan(x, vec3(0.0031308)));
#else
    return radiance;
#endif
}

void main() {
    vec3 n = normalize(v_normal);
    vec3 v = normalize(u_eye - v_position);
    vec3 radiance = vec3(0.0);
    for (int k = 0; k < LF_LIGHTS; ++k) {
        vec3 l;
        vec3 irradiance = lf_light(u_light[k], u_light_rgb[k], v_position, l);
        radiance += lf_brdf(n, v, l) * irradiance * max(dot(n, l), 0.0);
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
