#version 330 core
// black_anodised_aluminium: Coat over Conductor.
// Printed by layerfit 0.1.0 from its precise form.
// Left out, because this material does without: nothing.
// Indices of refraction are relative to the layer above: its own index divides those in the preset.
//
// vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha_x;  // width of the facet slopes along the tangent; the square of an artist's roughness
    float alpha_y;  // width of the facet slopes across the tangent; the square of an artist's roughness
    float eta;      // index of refraction, against air
    vec3 tau;       // optical depth, one way at normal incidence
};

struct Interface {
    float tilt;        // turn of the mean facet towards a grazing direction
    float gain;        // part of the reflected light that a second facet lets in
    vec4 passed;       // energy that passes, beyond the closed form: four coefficients
    vec2 passed_high;  // the other two, of higher powers
    vec4 bend;         // part by which the sine of light becomes smaller below
    vec2 bend_high;
    vec4 spread;       // width of a lobe seen through it, over that of the facets
    vec2 spread_high;
    vec4 path;         // mean path over that of the refracted direction
    vec2 path_high;
    vec4 theta;        // scale of the path's distribution
    vec2 theta_high;
};

struct Conductor {
    float alpha_x;  // width of the facet slopes along the tangent; the square of an artist's roughness
    float alpha_y;  // width of the facet slopes across the tangent; the square of an artist's roughness
    vec3 eta;       // index of refraction, real part
    vec3 k;         // index of refraction, imaginary part
};

struct Curve {
    vec3 c0;  // coefficients of the powers of the curves' argument
    vec3 c1;
    vec3 c2;
    vec3 c3;
    vec3 c4;
    vec3 c5;
};

struct Crossing {
    vec3 w;       // median direction
    float T;      // energy that passes
    vec2 a;       // spread, as a width
    float path;   // mean path, in thicknesses
    float theta;  // scale of the path's distribution
    float s;      // argument of the baked curves
    vec3 air;     // direction above
};

struct Shares {
    vec2 base;  // due to the base
    vec2 i;     // due to one crossing
    vec2 o;     // due to the other
};

const Coat lf_oxide = Coat(
    0.12,                             // alpha_x: width of the facet slopes along the tangent; the square of an artist's roughness
    0.3,                              // alpha_y: width of the facet slopes across the tangent; the square of an artist's roughness
    1.65,                             // eta: index of refraction, against air
    vec3(1.1, 1.1200001, 1.1600001)   // tau: optical depth, one way at normal incidence
);

const Interface lf_oxide_interface = Interface(
    0.030373108,                                               // tilt: turn of the mean facet towards a grazing direction
    0.051016223,                                               // gain: part of the reflected light that a second facet lets in
    vec4(-0.03604947, 0.010694278, 0.02764687, 0.0047039147),  // passed: energy that passes, beyond the closed form: four coefficients
    vec2(-0.007703439, -0.0034511923),                         // passed_high: the other two, of higher powers
    vec4(0.33516556, 0.08270949, -0.027979031, -0.006939888),  // bend: part by which the sine of light becomes smaller below
    vec2(0.0068604946, -0.0014256835),                         // bend_high
    vec4(0.6901757, -0.35035494, 0.07350148, 0.05722767),      // spread: width of a lobe seen through it, over that of the facets
    vec2(-0.08315079, -0.035616696),                           // spread_high
    vec4(1.1375977, -0.2171973, 0.07142246, 0.036595583),      // path: mean path over that of the refracted direction
    vec2(-0.02201134, -0.001537323),                           // path_high
    vec4(0.41057786, -0.7462359, 0.3733016, 0.0021906942),     // theta: scale of the path's distribution
    vec2(-0.08426255, 0.08728502)                              // theta_high
);

const Conductor lf_aluminium = Conductor(
    0.12,                                    // alpha_x: width of the facet slopes along the tangent; the square of an artist's roughness
    0.35,                                    // alpha_y: width of the facet slopes across the tangent; the square of an artist's roughness
    vec3(0.9115151, 0.59818184, 0.3678788),  // eta: index of refraction, real part
    vec3(4.641212, 3.9733336, 3.2454545)     // k: index of refraction, imaginary part
);

const Curve lf_oxide_again = Curve(
    vec3(0.1051283, 0.10233161, 0.096925735),       // c0: coefficients of the powers of the curves' argument
    vec3(0.003977226, 0.0039688814, 0.003958853),   // c1
    vec3(0.003590621, 0.00353764, 0.0034353547),    // c2
    vec3(0.015053451, 0.01464209, 0.013852745),     // c3
    vec3(-0.01022467, -0.009831402, -0.009081386),  // c4
    vec3(-0.018423066, -0.01781261, -0.01664561)    // c5
);

const Curve lf_oxide_rest = Curve(
    vec3(0.24074857, 0.23902494, 0.23320921),          // c0: coefficients of the powers of the curves' argument
    vec3(-0.0042296164, -0.004249595, -0.0042067617),  // c1
    vec3(0.0035166293, 0.0036134645, 0.0037835091),    // c2
    vec3(0.023409754, 0.02358687, 0.023740351),        // c3
    vec3(-0.026114613, -0.02594255, -0.025363632),     // c4
    vec3(-0.036583394, -0.036527455, -0.036093116)     // c5
);

const Interface lf_oxide_across = Interface(
    0.07474731,                                                // tilt: turn of the mean facet towards a grazing direction
    0.19855128,                                                // gain: part of the reflected light that a second facet lets in
    vec4(-0.0848371, 0.031376388, -0.008033876, 0.03345237),   // passed: energy that passes, beyond the closed form: four coefficients
    vec2(0.01668107, -0.007443741),                            // passed_high: the other two, of higher powers
    vec4(0.22314383, 0.10226743, 0.048828423, 0.006305933),    // bend: part by which the sine of light becomes smaller below
    vec2(-0.013409704, -0.0079526305),                         // bend_high
    vec4(0.49460143, -0.023766257, -0.05786392, -0.03701365),  // spread: width of a lobe seen through it, over that of the facets
    vec2(-0.021576107, -0.011080474),                          // spread_high
    vec4(1.2852762, -0.26076218, -0.07334012, 0.042782903),    // path: mean path over that of the refracted direction
    vec2(0.026287615, -6.0915947e-05),                         // path_high
    vec4(0.9425542, -1.0819294, -0.15661979, 0.31639296),      // theta: scale of the path's distribution
    vec2(0.092320696, -0.033271924)                            // theta_high
);

// How much of a rough top's effect on light is by slopes along the tangent: half of it at the normal, all along the tangent.
float lf_share_along(vec3 w) {
    return 0.5 * (1.0 + (w.x - w.y) * (w.x + w.y));
}

// The mean of two rough tops, `share` of the first.
Interface lf_mixed(Interface tangent, Interface across, float share) {
    float rest = 1.0 - share;
    float tilt = share * tangent.tilt + rest * across.tilt;
    float gain = share * tangent.gain + rest * across.gain;
    vec4 passed = share * tangent.passed + rest * across.passed;
    vec2 passed_high = share * tangent.passed_high + rest * across.passed_high;
    vec4 bend = share * tangent.bend + rest * across.bend;
    vec2 bend_high = share * tangent.bend_high + rest * across.bend_high;
    vec4 spread = share * tangent.spread + rest * across.spread;
    vec2 spread_high = share * tangent.spread_high + rest * across.spread_high;
    vec4 path = share * tangent.path + rest * across.path;
    vec2 path_high = share * tangent.path_high + rest * across.path_high;
    vec4 theta = share * tangent.theta + rest * across.theta;
    vec2 theta_high = share * tangent.theta_high + rest * across.theta_high;
    return Interface(tilt, gain, passed, passed_high, bend, bend_high, spread, spread_high, path, path_high, theta, theta_high);
}

// Argument of the baked curves: 1 / (NoW + .2) from the first node of the tables to 1, as -1 to 1.
float lf_grazing(float NoW) {
    return max(1.4645134 - 0.55741614 / (NoW + 0.2), -1.0);
}

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(vec3 w, float tilt) {
    return sqrt(max(tilt + (1.0 - tilt) * (w.z * w.z), 0.0));
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric(float c, float eta) {
    float g = sqrt((eta - 1.0) * (eta + 1.0) + c * c);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float passed = 2.0 * c * g * (perpendicular * perpendicular + eta2 * (parallel * parallel));
    return passed;
}

// Energy that passes a rough interface, from what passes the mean facet; `gain` is `second_facet`.
float lf_with_second_facet(float T, float gain) {
    return T + (1.0 - T) * gain;
}

// A polynomial of six coefficients at s.
float lf_curve(vec4 low, vec2 high, float s) {
    return low.x + s * (low.y + s * (low.z + s * (low.w + s * (high.x + s * high.y))));
}

// Follow one direction through the coat's rough top.
Crossing lf_pass_interface(Interface interface_, float eta, vec2 alpha, vec3 w) {
    float s = lf_grazing(w.z);
    float T = lf_with_second_facet(lf_transmittance_dielectric(lf_facet_cosine(w, interface_.tilt), eta), interface_.gain);
    T = max(T + lf_curve(interface_.passed, interface_.passed_high, s), 0.0);
    T = min(T, 1.0);
    float bend = max(lf_curve(interface_.bend, interface_.bend_high, s), 0.0);
    float z = sqrt(w.z * w.z + bend * (2.0 - bend) * dot(w.xy, w.xy));
    vec2 a = max(lf_curve(interface_.spread, interface_.spread_high, s), 0.0) * alpha;
    float path = max(lf_curve(interface_.path, interface_.path_high, s), 1.0) / z;
    float theta = max(lf_curve(interface_.theta, interface_.theta_high, s), 0.0);
    return Crossing(vec3(w.xy * (1.0 - bend), z), T, a, path, theta, s, w);
}

// The cosine between either direction and their half vector.
float lf_half_cosine(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return 0.5 * sqrt(dot(s, s));
}

// Exact reflectance of a dielectric boundary (Born and Wolf 1999, 1.5.2); 1 under total internal reflection.
float lf_fresnel_dielectric(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g2 = delta + c * c;
    float g = sqrt(g2);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float rs = perpendicular * perpendicular;
    float rp = ((eta2 + 1.0) * (c * c) - 1.0) * (parallel * parallel);
    float reflectance = 0.5 * (delta * delta) * (rs * rs + rp * rp);
    return reflectance;
}

// The unit vector halfway between two directions on the same side of the surface.
vec3 lf_half_vector(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    float inverse = inversesqrt(dot(s, s));
    return s * inverse;
}

// Anisotropic GGX density of facet normals (Burley 2012, eq. 13).
float lf_ggx_d_anisotropic(vec3 h, float alpha_x, float alpha_y) {
    float x = h.x / alpha_x;
    float y = h.y / alpha_y;
    float e = x * x + y * y + h.z * h.z;
    return 1.0 / (3.1415927 * alpha_x * alpha_y * e * e);
}

// NoW (1 + 2 Lambda) of the anisotropic GGX distribution (Heitz 2014, eqs. 72 and 80).
float lf_ggx_projection_anisotropic(vec3 w, float alpha_x, float alpha_y) {
    float x = alpha_x * w.x;
    float y = alpha_y * w.y;
    return sqrt(w.z * w.z + x * x + y * y);
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / (NoV * projection_l + NoL * projection_v);
}

// 0 where the indices match and there is no interface, 1 from 1.15 on.
float lf_presence(float eta) {
    return 2.0 - 1.0;
}

// What the width of a lobe is due to.
Shares lf_split(Crossing i, Crossing o, vec2 alpha) {
    vec2 base = alpha * (i.w.z + o.w.z);
    vec2 inverse = 1.0 / (base + i.a + o.a);
    return Shares(base * inverse, i.a * inverse, o.a * inverse);
}

// The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone.
vec3 lf_lean(Crossing x, Crossing i, Crossing o, vec2 share) {
    vec2 turn = 0.8241 * share * (i.w.xy + o.w.xy);
    float z2 = x.w.z * x.w.z;
    z2 = max(z2 + dot(turn, 2.0 * x.w.xy - turn), min(z2, 0.0004));
    return vec3(x.w.xy - turn, sqrt(z2));
}

// Mean path of light that the base sends on: between that of one direction and that of all that cross.
float lf_between(vec3 y, Crossing x, float part) {
    float straight = 1.0 / y.z;
    return straight + part * (x.path - straight);
}

// How the spread of paths shows at depth tau, 1 where all are alike: of an inverse Gaussian (Tweedie 1957).
vec3 lf_spread_root(float theta, vec3 tau) {
    return sqrt(1.0 + 2.0 * theta * tau);
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor(float c, vec3 eta, vec3 k) {
    float c2 = c * c;
    float s2 = 1.0 - c2;
    vec3 p = (eta - k) * (eta + k) - 1.0 + c2;
    vec3 nk2 = 2.0 * eta * k;
    vec3 q = sqrt(p * p + nk2 * nk2);
    vec3 larger = sqrt(q - p);
    vec3 twice_abc = 1.4142135 * nk2 * c;
    vec3 even = larger * (q * c2 + s2 * s2);
    vec3 odd = twice_abc * s2;
    vec3 across = larger * (q + c2);
    return (across - twice_abc) * even / ((across + twice_abc) * (even + odd));
}

// The polynomial at s; an energy is never below 0.
vec3 lf_amount(Curve curve, float s) {
    return curve.c0 + s * (curve.c1 + s * (curve.c2 + s * (curve.c3 + s * (curve.c4 + s * curve.c5))));
}

// The squared width of a lobe of this width, seen by way of slopes that spread it.
vec2 lf_blurred2(vec2 width, vec2 spread) {
    vec2 shared_ = width * spread / max(width + spread, 1e-14);
    return width * width + spread * spread + 3.173 * (shared_ * shared_);
}

// Density of a lobe about the refracted directions, of a base of width alpha seen through the interface twice; M is the sum of the cosines.
float lf_lobe(Crossing i, Crossing o, float M, vec2 alpha) {
    vec2 base = alpha * M;
    vec2 width2 = lf_blurred2(base, i.a + o.a);
    float size = sqrt(width2.x * width2.y);
    vec2 t = base * base + 0.8294 * (i.a * i.a + o.a * o.a);
    float x = 0.3431 * (size / sqrt(t.x * t.y) - 1.0);
    t = i.w.xy + o.w.xy;
    float v = t.x * t.x / width2.x + t.y * t.y / width2.y;
    return 1.0 / (3.1415927 * size * (1.0 + v * (2.0 - x * (1.986 - x * (0.668 - 0.1745 * x)) + (1.0 + x) * v)));
}

// The squared width of a lobe of this width, seen by way of slopes that spread it.
vec2 lf_blurred22(vec2 width, vec2 spread) {
    vec2 shared_ = width * spread / (width + spread);
    return width * width + spread * spread + 3.173 * (shared_ * shared_);
}

// Width of the lobe of light that met a base of width alpha twice, and the coat in between.
vec2 lf_wider(vec2 alpha, vec2 coat_alpha) {
    return sqrt(lf_blurred22(sqrt(lf_blurred22(alpha, alpha)), 0.4 * coat_alpha));
}

// What is left of the direction in light that went to and fro, over pi: more goes on than back, the smoother the base.
float lf_ahead(Crossing i, Crossing o, float alpha) {
    vec2 apart = i.air.xy - o.air.xy;
    float back = 0.5 * (dot(apart, apart) + i.air.z * i.air.z + o.air.z * o.air.z);
    return (alpha + (1.0 - alpha) * back) / 3.1415927;
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith2(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / max(NoV * projection_l + NoL * projection_v, 1e-14);
}

// Part of a density of facets that is seen and hides nothing, without the projected areas; h2 is the square of the sum of both directions.
float lf_seen(vec3 yi, vec3 yo, float h2, vec2 width) {
    float M = yi.z + yo.z;
    float slope = h2 / M;
    float projection_i = lf_ggx_projection_anisotropic(yi, width.x, width.y);
    float projection_o = lf_ggx_projection_anisotropic(yo, width.x, width.y);
    return slope * slope * (yi.z * yo.z) * lf_v_smith2(yi.z, yo.z, projection_i, projection_o);
}

// BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine.
vec3 lf_evaluate(vec3 wi, vec3 wo) {
    bool lit = min(wi.z, wo.z) > 1e-07;
    Interface interface_ = lf_mixed(lf_oxide_interface, lf_oxide_across, lf_share_along(wi));
    Crossing crossing = lf_pass_interface(interface_, lf_oxide.eta, vec2(lf_oxide.alpha_x, lf_oxide.alpha_y), wi);
    interface_ = lf_mixed(lf_oxide_interface, lf_oxide_across, lf_share_along(wo));
    Crossing crossing2 = lf_pass_interface(interface_, lf_oxide.eta, vec2(lf_oxide.alpha_x, lf_oxide.alpha_y), wo);
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_oxide.eta);
    float D = lf_ggx_d_anisotropic(lf_half_vector(wi, wo), lf_oxide.alpha_x, lf_oxide.alpha_y);
    float projection_i = lf_ggx_projection_anisotropic(wi, lf_oxide.alpha_x, lf_oxide.alpha_y);
    float projection_o = lf_ggx_projection_anisotropic(wo, lf_oxide.alpha_x, lf_oxide.alpha_y);
    float V = lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    float throughput = crossing.T * crossing2.T / (lf_oxide.eta * lf_oxide.eta);
    vec2 top = vec2(lf_oxide.alpha_x, lf_oxide.alpha_y);
    vec2 own = vec2(lf_aluminium.alpha_x, lf_aluminium.alpha_y);
    float there = lf_presence(lf_oxide.eta);
    Shares shares = lf_split(crossing, crossing2, own);
    float share = 0.5 * (shares.base.x + shares.base.y);
    float part = 0.7911 * share;
    vec3 yi = lf_lean(crossing, crossing, crossing2, there * shares.i);
    vec3 yo = lf_lean(crossing2, crossing, crossing2, there * shares.o);
    float path_i = lf_between(yi, crossing, part);
    float path_o = lf_between(yo, crossing2, part);
    vec3 root_i = lf_spread_root(part * crossing.theta, lf_oxide.tau);
    vec3 root_o = lf_spread_root(part * crossing2.theta, lf_oxide.tau);
    vec3 U = (1.0 + (path_i - 1.0) / root_i) * (1.0 + (path_o - 1.0) / root_o);
    vec3 throughput2 = throughput * exp(-(lf_oxide.tau + (path_i - 1.0) * (2.0 * lf_oxide.tau / (1.0 + root_i)) + (lf_oxide.tau + (path_o - 1.0) * (2.0 * lf_oxide.tau / (1.0 + root_o)))));
    vec3 h = yi + yo;
    float h2 = dot(h, h);
    vec3 F2 = lf_fresnel_conductor(min(0.5 * sqrt(h2), 1.0), lf_aluminium.eta, lf_aluminium.k);
    float even = sqrt(0.5 * (lf_oxide.alpha_x * lf_oxide.alpha_x + lf_oxide.alpha_y * lf_oxide.alpha_y));
    float rise = 1.0 + 0.3861 * there * even * even * share;
    vec3 again = F2 * (lf_amount(lf_oxide_again, crossing.s) * lf_amount(lf_oxide_again, crossing2.s));
    vec3 lobes = rise * lf_lobe(crossing, crossing2, h.z, own) + again * lf_lobe(crossing, crossing2, h.z, lf_wider(own, top));
    vec3 root = lf_amount(lf_oxide_rest, crossing.s) * lf_amount(lf_oxide_rest, crossing2.s);
    vec3 rest = root * root * lf_ahead(crossing, crossing2, sqrt(0.5 * (lf_aluminium.alpha_x * lf_aluminium.alpha_x + lf_aluminium.alpha_y * lf_aluminium.alpha_y)));
    vec3 value = F * (D * V) + throughput2 * (F2 * U * (lf_seen(yi, yo, h2, own) * lobes) + rest);
    return lit ? value : vec3(0.0);
}

// BRDF [1/sr] in any frame; t is a tangent, along which alpha_x is measured.
vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l) {
    vec3 x = normalize(t - dot(t, n) * n);
    mat3 surface = transpose(mat3(x, cross(n, x), n));
    return lf_evaluate(surface * l, surface * v);
}

#ifndef LF_LIBRARY

#ifndef LF_LIGHTS
#define LF_LIGHTS 1
#endif

in vec3 v_position;  // this, u_eye and u_light in one space, such as the world's
in vec3 v_normal;
in vec3 v_tangent;   // along which widths and patterns are measured
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
        radiance += lf_brdf(n, v_tangent, v, l) * irradiance * max(dot(n, l), 0.0);
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
