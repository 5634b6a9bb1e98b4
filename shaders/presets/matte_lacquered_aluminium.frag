#version 330 core
// matte_lacquered_aluminium: Coat over Conductor.
// Printed by layerfit 0.1.0 from its precise form.
// Left out, because this material does without: lacquer: anisotropy, aluminium: anisotropy.
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

struct Conductor {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
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

struct Crossing {
    vec4 w;       // median direction
    float T;      // energy that passes
    float a;      // spread, as a width
    float path;   // mean path, in thicknesses
    float theta;  // scale of the path's distribution
    float s;      // argument of the baked curves
};

const Coat lf_lacquer = Coat(
    0.35,                              // alpha: width of the facet slopes; the square of an artist's roughness
    1.5,                               // eta: index of refraction, against air
    vec3(0.015000001, 0.0175, 0.025)   // tau: optical depth, one way at normal incidence
);

const Interface lf_lacquer_interface = Interface(
    0.08523813,                                                  // tilt: turn of the mean facet towards a grazing direction
    0.23253432,                                                  // gain: part of the reflected light that a second facet lets in
    vec4(-0.08829561, 0.06921207, -0.0025319979, 0.046828307),   // passed: energy that passes, beyond the closed form: four coefficients
    vec4(-0.03677714, -0.02923125, 0.019881316, 0.0019443259),   // passed_high: the other four, of higher powers
    vec4(1.1908898, -0.18565702, 0.023200512, 0.06637478),       // bend: sine of the refracted light over that at a smooth interface
    vec4(-0.022238255, -0.021943092, 0.0071253777, 0.00404644),  // bend_high: 
    vec4(0.4670237, -0.05129976, -0.09916952, 0.02692759),       // spread: width of a lobe seen through it
    vec4(0.041081667, -0.027884007, -0.010092378, 0.008688688),  // spread_high: 
    vec4(1.1454061, -0.22828844, 0.104338646, 0.04807949),       // path: mean path over that of the refracted direction
    vec4(-0.09155941, 0.036605835, 0.027258635, -0.02371645),    // path_high: 
    vec4(0.33835986, -0.5951677, 0.3756616, 0.09792897),         // theta: scale of the path's distribution
    vec4(-0.33255088, 0.12613332, 0.11371158, -0.0620794)        // theta_high: 
);

const Conductor lf_aluminium = Conductor(
    0.15,                                     // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(1.1053333, 0.58666664, 0.34733334),  // eta: index of refraction, real part
    vec3(6.1493335, 4.18, 3.2246666)          // k: index of refraction, imaginary part
);

const Curve lf_lacquer_again = Curve(
    vec3(0.2628071, 0.26119745, 0.25481865),          // c0: coefficients of the powers of the curves' argument
    vec3(-0.05472103, -0.054050058, -0.051126435),    // c1: 
    vec3(-0.078514025, -0.078691855, -0.0796158),     // c2: 
    vec3(0.026235998, 0.025698483, 0.022902757),      // c3: 
    vec3(-0.012775689, -0.010673702, -0.0038031936),  // c4: 
    vec3(-0.09212136, -0.0908072, -0.085089564),      // c5: 
    vec3(0.014962852, 0.013605267, 0.009397745),      // c6: 
    vec3(0.05061704, 0.049736083, 0.046360612)        // c7: 
);

const Curve lf_lacquer_rest = Curve(
    vec3(0.72037584, 0.7106466, 0.7028714),         // c0: coefficients of the powers of the curves' argument
    vec3(-0.13313244, -0.13201264, -0.12925419),    // c1: 
    vec3(-0.08704963, -0.08799422, -0.095091015),   // c2: 
    vec3(0.06703544, 0.06603885, 0.061610222),      // c3: 
    vec3(-0.058227062, -0.052171588, -0.03435409),  // c4: 
    vec3(-0.18883395, -0.18477798, -0.17468047),    // c5: 
    vec3(0.023964882, 0.020658612, 0.0109267235),   // c6: 
    vec3(0.092136145, 0.089716196, 0.08372283)      // c7: 
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
    float a = lf_curve(interface_.spread, interface_.spread_high, s) * alpha;
    float path = max(lf_curve(interface_.path, interface_.path_high, s), 1.0) / z;
    float theta = max(lf_curve(interface_.theta, interface_.theta_high, s), 1e-04);
    return Crossing(vec4(w.xyz * bend, z), T, a, path, theta, s);
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

// Part of a lobe's width, as a power, that is due to the base.
float lf_base_share(Crossing i, Crossing o, float alpha) {
    float base = pow(max(alpha * (i.w.w + o.w.w), 1e-30), 1.412);
    return base / (base + pow(i.a, 1.412) + pow(o.a, 1.412));
}

// The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone.
vec4 lf_lean(Crossing x, Crossing i, Crossing o, float alpha) {
    float own = pow(x.a, 1.412);
    float total = pow(max(alpha * (i.w.w + o.w.w), 1e-30), 1.412) + pow(i.a, 1.412) + pow(o.a, 1.412);
    float turn = 0.7504 * own / total;
    vec3 y = x.w.xyz - turn * (i.w.xyz + o.w.xyz);
    float sine = sqrt(dot(y, y));
    float held = min(1.0, 0.9998 / max(sine, 1e-06));
    sine = min(sine, 0.9998);
    return vec4(y * held, sqrt((1.0 - sine) * (1.0 + sine)));
}

// Part of the path's spread that counts, by the base's share of the width.
float lf_direct(float share, float d, float c, float e) {
    return min(max(d + c * pow(max(share, 1e-30), e), 0.0), 1.5);
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

// 0 where the indices match and there is no interface, 1 from the first index of the tables on.
float lf_presence(float eta) {
    return 2.0 - 1.0;
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
    float spread = pow(i.a, 1.412) + pow(o.a, 1.412);
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
vec3 lf_amount(Curve curve, float s) {
    vec3 upper = curve.c4 + s * (curve.c5 + s * (curve.c6 + s * curve.c7));
    return max(curve.c0 + s * (curve.c1 + s * (curve.c2 + s * (curve.c3 + s * upper))), 0.0);
}

// Width of the lobe of light that met a base of width alpha twice, and the coat in between.
float lf_wider(float alpha, float coat_alpha) {
    return pow(2.0 * pow(alpha, 1.412) + 0.5751 * pow(coat_alpha, 1.412), 0.7082153);
}

// The polynomial at s; an energy is never below 0.
vec3 lf_amount2(Curve curve, float s) {
    vec3 upper = curve.c4 + s * (curve.c5 + s * (curve.c6 + s * curve.c7));
    return curve.c0 + s * (curve.c1 + s * (curve.c2 + s * (curve.c3 + s * upper)));
}

// What is left of the direction in light that went to and fro, over pi: more goes on than back, the smoother the base.
float lf_ahead(Crossing i, Crossing o, float eta, float alpha) {
    float back = eta * eta * dot(i.w.xyz, o.w.xyz);
    return max(1.0 - (1.0 - alpha) * back, 0.0) / 3.1415927;
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(vec4 wi, vec4 wo) {
    bool lit = min(wi.w, wo.w) > 0.0;
    Crossing crossing = lf_pass_interface(lf_lacquer_interface, lf_lacquer.eta, lf_lacquer.alpha, wi);
    Crossing crossing2 = lf_pass_interface(lf_lacquer_interface, lf_lacquer.eta, lf_lacquer.alpha, wo);
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_lacquer.eta);
    float D = lf_ggx_d(lf_half_vector(wi, wo), lf_lacquer.alpha);
    float projection_i = lf_ggx_projection(wi, lf_lacquer.alpha);
    float projection_o = lf_ggx_projection(wo, lf_lacquer.alpha);
    float V = lf_v_smith(wi.w, wo.w, projection_i, projection_o);
    float throughput = crossing.T * crossing2.T / (lf_lacquer.eta * lf_lacquer.eta);
    float share = lf_base_share(crossing, crossing2, lf_aluminium.alpha);
    vec4 yi = lf_lean(crossing, crossing, crossing2, lf_aluminium.alpha);
    vec4 yo = lf_lean(crossing2, crossing, crossing2, lf_aluminium.alpha);
    float part = lf_direct(share, 0.3296, 0.3522, 1.803);
    vec3 A = lf_absorbed(lf_between(yi, crossing, part), part * crossing.theta, lf_lacquer.tau);
    part = lf_direct(share, 0.3096, 0.2662, 1.772);
    float path = lf_between(yi, crossing, part);
    vec3 U = lf_projected(path, part * crossing.theta, lf_lacquer.tau);
    part = lf_direct(share, 0.3296, 0.3522, 1.803);
    A = A * lf_absorbed(lf_between(yo, crossing2, part), part * crossing2.theta, lf_lacquer.tau);
    part = lf_direct(share, 0.3096, 0.2662, 1.772);
    path = lf_between(yo, crossing2, part);
    U = U * lf_projected(path, part * crossing2.theta, lf_lacquer.tau);
    vec3 F2 = lf_fresnel_conductor(lf_half_cosine2(yi, yo), lf_aluminium.eta, lf_aluminium.k);
    float rise = 1.0 + 0.3036 * lf_presence(lf_lacquer.eta) * lf_lacquer.alpha * lf_lacquer.alpha * share;
    float lobes = rise * lf_lobe(crossing, crossing2, yi, yo, lf_aluminium.alpha, lf_aluminium.alpha);
    vec3 again = 0.5 * F2 * (lf_amount(lf_lacquer_again, crossing.s) + lf_amount(lf_lacquer_again, crossing2.s));
    vec3 lobes2 = lobes + again * lf_lobe(crossing, crossing2, yi, yo, lf_wider(lf_aluminium.alpha, lf_lacquer.alpha), lf_aluminium.alpha);
    vec3 root = lf_amount2(lf_lacquer_rest, crossing.s) * lf_amount2(lf_lacquer_rest, crossing2.s);
    vec3 rest = root * root * lf_ahead(crossing, crossing2, lf_lacquer.eta, lf_aluminium.alpha);
    vec3 value = F * D * V + throughput * A * (F2 * U * lobes2 + rest);
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
