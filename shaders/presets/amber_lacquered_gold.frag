#version 330 core
// amber_lacquered_gold: Coat over Conductor.
// Printed by layerfit 0.1.0 from its precise form.
// Left out, because this material does without: shellac: anisotropy, gold: anisotropy.
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
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
};

struct Curve {
    vec3 c0;  // coefficients of the powers of the curves' argument
    vec3 c1;
    vec3 c2;
    vec3 c3;
    vec3 c4;
    vec3 c5;
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

struct Crossing {
    vec3 w_along;      // median direction: part along the surface, in any space
    float w_cosine;    // median direction: cosine to its normal
    float T;           // energy that passes
    float a;           // spread, as a width
    float path;        // mean path, in thicknesses
    float theta;       // scale of the path's distribution
    float s;           // argument of the baked curves
    vec3 air_along;    // direction above: part along the surface, in any space
    float air_cosine;  // direction above: cosine to its normal
};

struct Shares {
    float base;  // due to the base
    float i;     // due to one crossing
    float o;     // due to the other
};

const Coat lf_shellac = Coat(
    0.05,                   // alpha: width of the facet slopes; the square of an artist's roughness
    1.52,                   // eta: index of refraction, against air
    vec3(0.03, 0.12, 0.4)   // tau: optical depth, one way at normal incidence
);

const Interface lf_shellac_interface = Interface(
    0.010720346,                                                  // tilt: turn of the mean facet towards a grazing direction
    0.009790741,                                                  // gain: part of the reflected light that a second facet lets in
    vec4(-0.024019195, 0.037430365, -0.012146365, -0.008774286),  // passed: energy that passes, beyond the closed form: four coefficients
    vec2(0.01589695, -0.00900097),                                // passed_high: the other two, of higher powers
    vec4(0.33006918, 0.021768995, -0.018093288, 0.013072789),     // bend: part by which the sine of light becomes smaller below
    vec2(-0.0058472306, 0.0002579987),                            // bend_high
    vec4(0.6123964, -0.28842166, 0.24142314, -0.31251183),        // spread: width of a lobe seen through it, over that of the facets
    vec2(0.0021076351, 0.05370462),                               // spread_high
    vec4(1.041125, -0.086186826, 0.086508214, -0.056506038),      // path: mean path over that of the refracted direction
    vec2(-0.0011351705, 0.017382026),                             // path_high
    vec4(0.09075124, -0.2020707, 0.24339886, -0.256472),          // theta: scale of the path's distribution
    vec2(0.061698347, 0.08315918)                                 // theta_high
);

const Conductor lf_gold = Conductor(
    0.18,                                     // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(0.013157895, 0.3263158, 0.9710526),  // eta: index of refraction, real part
    vec3(1.7355263, 1.4802632, 1.1697369)     // k: index of refraction, imaginary part
);

const Curve lf_shellac_again = Curve(
    vec3(0.41007033, 0.36309215, 0.2537688),        // c0: coefficients of the powers of the curves' argument
    vec3(-0.01659469, -0.014080793, -0.008570049),  // c1
    vec3(0.05046711, 0.045693308, 0.030768678),     // c2
    vec3(0.0075012445, 0.005959958, 0.0017178655),  // c3
    vec3(-0.12749663, -0.11129109, -0.07341492),    // c4
    vec3(-0.10804489, -0.093536645, -0.059924096)   // c5
);

const Curve lf_shellac_rest = Curve(
    vec3(0.9396438, 0.62593496, 0.29271707),        // c0: coefficients of the powers of the curves' argument
    vec3(-0.07062769, -0.047082566, -0.022610608),  // c1
    vec3(0.025603369, 0.014388591, 0.0050966144),   // c2
    vec3(0.0273934, 0.017851233, 0.011184663),      // c3
    vec3(-0.1832937, -0.12210363, -0.06094332),     // c4
    vec3(-0.19600457, -0.13269022, -0.06895977)     // c5
);

// Argument of the baked curves: 1 / (NoW + .2) from the first node of the tables to 1, as -1 to 1.
float lf_grazing(float NoW) {
    return max(1.4645134 - 0.55741614 / (NoW + 0.2), -1.0);
}

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(FreeDirection w, float tilt) {
    return sqrt(tilt + (1.0 - tilt) * (w.cosine * w.cosine));
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
Crossing lf_pass_interface(Interface interface_, float eta, float alpha, FreeDirection w) {
    float s = lf_grazing(w.cosine);
    float T = lf_with_second_facet(lf_transmittance_dielectric(lf_facet_cosine(w, interface_.tilt), eta), interface_.gain);
    T = max(T + lf_curve(interface_.passed, interface_.passed_high, s), 0.0);
    T = min(T, 1.0);
    float bend = lf_curve(interface_.bend, interface_.bend_high, s);
    float z = sqrt(w.cosine * w.cosine + bend * (2.0 - bend) * dot(w.along, w.along));
    float a = max(lf_curve(interface_.spread, interface_.spread_high, s), 0.0) * alpha;
    float path = max(lf_curve(interface_.path, interface_.path_high, s), 1.0) / z;
    float theta = max(lf_curve(interface_.theta, interface_.theta_high, s), 0.0);
    return Crossing(w.along * (1.0 - bend), z, T, a, path, theta, s, w.along, w.cosine);
}

// The cosine between either direction and their half vector.
float lf_half_cosine(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    return 0.5 * sqrt(dot(along, along) + cosine * cosine);
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
FreeDirection lf_half_vector(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    float inverse = inversesqrt(dot(along, along) + cosine * cosine);
    return FreeDirection(along * inverse, cosine * inverse);
}

// NoW (1 + 2 Lambda) of the GGX distribution (Heitz 2014, eq. 72, multiplied out).
float lf_ggx_projection(FreeDirection w, float alpha) {
    float a2 = alpha * alpha;
    return sqrt(a2 + (1.0 - a2) * (w.cosine * w.cosine));
}

// D V, the GGX density (Walter et al. 2007, eq. 33) and height-correlated Smith masking (Heitz 2014, eq. 99), by one division.
float lf_ggx_lobe(FreeDirection wi, FreeDirection wo, FreeDirection h, float alpha) {
    float a2 = alpha * alpha;
    float e = dot(h.along, h.along) + a2 * (h.cosine * h.cosine);
    float hidden = wo.cosine * lf_ggx_projection(wi, alpha) + wi.cosine * lf_ggx_projection(wo, alpha);
    return 0.15915494 * a2 / (e * e * hidden);
}

// 0 where the indices match and there is no interface, 1 from 1.15 on.
float lf_presence(float eta) {
    return 2.0 - 1.0;
}

// What the width of a lobe is due to.
Shares lf_split(Crossing i, Crossing o, float alpha) {
    float base = alpha * (i.w_cosine + o.w_cosine);
    float inverse = 1.0 / (base + i.a + o.a);
    return Shares(base * inverse, i.a * inverse, o.a * inverse);
}

// The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone.
FreeDirection lf_lean(Crossing x, Crossing i, Crossing o, float share) {
    vec3 turn = 0.8241 * share * (i.w_along + o.w_along);
    float z2 = x.w_cosine * x.w_cosine;
    z2 = max(z2 + dot(turn, 2.0 * x.w_along - turn), min(z2, 0.0004));
    return FreeDirection(x.w_along - turn, sqrt(z2));
}

// Mean path of light that the base sends on: between that of one direction and that of all that cross.
float lf_between(FreeDirection y, Crossing x, float part) {
    float straight = 1.0 / y.cosine;
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
float lf_blurred2(float width, float spread) {
    float shared_ = width * spread / (width + spread);
    return width * width + spread * spread + 3.173 * (shared_ * shared_);
}

// Density of a lobe about the refracted directions, of a base of width alpha seen through the interface twice; M is the sum of the cosines.
float lf_lobe(Crossing i, Crossing o, float M, float alpha) {
    float base = alpha * M;
    float width2 = lf_blurred2(base, i.a + o.a);
    float x = 0.3431 * (width2 / (base * base + 0.8294 * (i.a * i.a + o.a * o.a)) - 1.0);
    vec3 t = i.w_along + o.w_along;
    float v = dot(t, t) / width2;
    return 1.0 / (3.1415927 * width2 * (1.0 + v * (2.0 - x * (1.986 - x * (0.668 - 0.1745 * x)) + (1.0 + x) * v)));
}

// Width of the lobe of light that met a base of width alpha twice, and the coat in between.
float lf_wider(float alpha, float coat_alpha) {
    return sqrt(lf_blurred2(sqrt(lf_blurred2(alpha, alpha)), 0.4 * coat_alpha));
}

// What is left of the direction in light that went to and fro, over pi: more goes on than back, the smoother the base.
float lf_ahead(Crossing i, Crossing o, float alpha) {
    vec3 apart = i.air_along - o.air_along;
    float back = 0.5 * (dot(apart, apart) + i.air_cosine * i.air_cosine + o.air_cosine * o.air_cosine);
    return (alpha + (1.0 - alpha) * back) / 3.1415927;
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / (NoV * projection_l + NoL * projection_v);
}

// Part of a density of facets that is seen and hides nothing, without the projected areas; h2 is the square of the sum of both directions.
float lf_seen(FreeDirection yi, FreeDirection yo, float h2, float width) {
    float M = yi.cosine + yo.cosine;
    float slope = h2 / M;
    float projection_i = lf_ggx_projection(yi, width);
    float projection_o = lf_ggx_projection(yo, width);
    return slope * slope * (yi.cosine * yo.cosine) * lf_v_smith(yi.cosine, yo.cosine, projection_i, projection_o);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    Crossing crossing = lf_pass_interface(lf_shellac_interface, lf_shellac.eta, lf_shellac.alpha, wi);
    Crossing crossing2 = lf_pass_interface(lf_shellac_interface, lf_shellac.eta, lf_shellac.alpha, wo);
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_shellac.eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float throughput = crossing.T * crossing2.T / (lf_shellac.eta * lf_shellac.eta);
    float there = lf_presence(lf_shellac.eta);
    Shares shares = lf_split(crossing, crossing2, lf_gold.alpha);
    float part = 0.7911 * shares.base;
    FreeDirection yi = lf_lean(crossing, crossing, crossing2, there * shares.i);
    FreeDirection yo = lf_lean(crossing2, crossing, crossing2, there * shares.o);
    float path_i = lf_between(yi, crossing, part);
    float path_o = lf_between(yo, crossing2, part);
    vec3 root_i = lf_spread_root(part * crossing.theta, lf_shellac.tau);
    vec3 root_o = lf_spread_root(part * crossing2.theta, lf_shellac.tau);
    vec3 U = (1.0 + (path_i - 1.0) / root_i) * (1.0 + (path_o - 1.0) / root_o);
    vec3 throughput2 = throughput * exp(-(lf_shellac.tau + (path_i - 1.0) * (2.0 * lf_shellac.tau / (1.0 + root_i)) + (lf_shellac.tau + (path_o - 1.0) * (2.0 * lf_shellac.tau / (1.0 + root_o)))));
    vec3 along = yi.along + yo.along;
    float cosine = yi.cosine + yo.cosine;
    float h2 = dot(along, along) + cosine * cosine;
    vec3 F2 = lf_fresnel_conductor(min(0.5 * sqrt(h2), 1.0), lf_gold.eta, lf_gold.k);
    float rise = 1.0 + 0.3861 * there * lf_shellac.alpha * lf_shellac.alpha * shares.base;
    vec3 again = F2 * (lf_amount(lf_shellac_again, crossing.s) * lf_amount(lf_shellac_again, crossing2.s));
    vec3 lobes = rise * lf_lobe(crossing, crossing2, cosine, lf_gold.alpha) + again * lf_lobe(crossing, crossing2, cosine, lf_wider(lf_gold.alpha, lf_shellac.alpha));
    vec3 root = lf_amount(lf_shellac_rest, crossing.s) * lf_amount(lf_shellac_rest, crossing2.s);
    vec3 rest = root * root * lf_ahead(crossing, crossing2, lf_gold.alpha);
    vec3 value = F * lf_ggx_lobe(wi, wo, direction, lf_shellac.alpha) + throughput2 * (F2 * U * (lf_seen(yi, yo, h2, lf_gold.alpha) * lobes) + rest);
    return lit ? value : vec3(0.0);
}

// BRDF [1/sr] in any frame: an isotropic surface asks for no tangent.
vec3 lf_brdf(vec3 n, vec3 v, vec3 l) {
    float NoL = dot(n, l);
    float NoV = dot(n, v);
    return lf_evaluate(FreeDirection(l - NoL * n, NoL), FreeDirection(v - NoV * n, NoV));
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
