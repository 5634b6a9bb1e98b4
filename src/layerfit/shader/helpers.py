"""Functions that JAX has and GLSL has not, to float32 accuracy. Functions of one number also come, channel by channel, for a vec3.

Both sides are computed and given names, and one is chosen. A return inside an `if`, or a sum inside a `?:`, is a branch, inlined once for every
call: with them, Chromium's software driver compiles flakes under a coat for minutes, in gigabytes, until the browser ends it; without, in a second.
"""

_SCALAR = {
    "erf": """\
// Error function: a series in x^2 below 1, exp(-x^2) times a polynomial in 1 / (1 + x / 2) above (relative error 1.3e-7).
float lf_erf(float x) {
    float a = abs(x);
    float u = x * x;
    float near = x * (1.1283791 + u * (-0.3761232 + u * (0.11280131 + u * (-0.02670995 + u * (0.004916023 - u * 0.00056253962)))));
    float t = 1.0 / (1.0 + 0.5 * a);
    float p = 0.2814202 + t * (0.28951687 + t * (0.21660148 + t * (0.2249226 + t * (0.08896493 - t * 0.10282357))));
    float far = sign(x) * (1.0 - t * p * exp(-u));
    return a < 1.0 ? near : far;
}
""",
    "expm1": """\
// exp(x) - 1 without the cancellation near 0.
float lf_expm1(float x) {
    float near = x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0))))));
    float far = exp(x) - 1.0;
    return abs(x) > 0.4 ? far : near;
}
""",
    "log1p": """\
// log(1 + x) without the cancellation near 0.
float lf_log1p(float x) {
    float s = x / (2.0 + x);
    float u = s * s;
    float near = 2.0 * s * (1.0 + u * (1.0 / 3.0 + u * (1.0 / 5.0 + u * (1.0 / 7.0 + u * (1.0 / 9.0 + u / 11.0)))));
    float far = log(1.0 + x);
    return abs(x) > 0.3 ? far : near;
}
""",
}

_PAIR = {
    "atan2": """\
// Angle of the point (x, y) by a polynomial (relative error 2e-8): some drivers' atan is off by 2e-4.
float lf_atan2(float y, float x) {
    float ax = abs(x);
    float ay = abs(y);
    float t = min(ax, ay) / max(max(ax, ay), 1e-30);
    float u = t * t;
    float p = 0.10622653 + u * (-0.07465779 + u * (0.042241037 + u * (-0.015793836 + u * 0.0027817077)));
    float a = t * (1.0 + u * (-0.33333045 + u * (0.19992018 + u * (-0.1419892 + u * p))));
    a = ay > ax ? 1.5707964 - a : a;
    a = x < 0.0 ? 3.1415927 - a : a;
    return y < 0.0 ? -a : a;
}
""",
}

HELPERS = {
    name: f"{text}\nvec3 lf_{name}(vec3 x) {{\n    return vec3(lf_{name}(x.x), lf_{name}(x.y), lf_{name}(x.z));\n}}\n"
    for name, text in _SCALAR.items()
} | _PAIR
