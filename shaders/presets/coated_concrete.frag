#version 330 core
// coated_concrete: Coat over OrenNayar.
// Printed by layerfit 0.1.0 from its precise form.
// Left out, because this material does without: sealer: anisotropy.
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

struct OrenNayar {
    vec3 albedo;  // part of the light that is sent back
    float sigma;  // standard deviation of the facet angle [rad]
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

const Coat lf_sealer = Coat(
    0.07,                    // alpha: width of the facet slopes; the square of an artist's roughness
    1.48,                    // eta: index of refraction, against air
    vec3(0.03, 0.05, 0.09)   // tau: optical depth, one way at normal incidence
);

const Interface lf_sealer_interface = Interface(
    0.016290857,                                                // tilt: turn of the mean facet towards a grazing direction
    0.018790323,                                                // gain: part of the reflected light that a second facet lets in
    vec4(-0.030293863, 0.03411546, 0.007858283, -0.016438136),  // passed: energy that passes, beyond the closed form: four coefficients
    vec2(0.0055495244, -0.0017564549),                          // passed_high: the other two, of higher powers
    vec4(0.30287337, 0.037373878, -0.027368307, 0.012910545),   // bend: part by which the sine of light becomes smaller below
    vec2(0.0011300743, -0.004229963),                           // bend_high
    vec4(0.60811496, -0.33474666, 0.22261092, -0.17075449),     // spread: width of a lobe seen through it, over that of the facets
    vec2(-0.089451894, 0.05588582),                             // spread_high
    vec4(1.0675288, -0.13411361, 0.10158929, -0.032689452),     // path: mean path over that of the refracted direction
    vec2(-0.020755887, 0.020025134),                            // path_high
    vec4(0.15087932, -0.33279446, 0.3304903, -0.2277554),       // theta: scale of the path's distribution
    vec2(-0.014587497, 0.115838975)                             // theta_high
);

const OrenNayar lf_concrete = OrenNayar(
    vec3(0.42, 0.4, 0.37),  // albedo: part of the light that is sent back
    0.5                     // sigma: standard deviation of the facet angle [rad]
);

const vec3 lf_concrete_returned = vec3(0.48894167, 0.44730926, 0.3775133);

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

// How the spread of paths shows at depth tau, 1 where all are alike: of an inverse Gaussian (Tweedie 1957).
vec3 lf_spread_root(float theta, vec3 tau) {
    return sqrt(1.0 + 2.0 * theta * tau);
}

// Oren and Nayar 1994, eqs. 25 to 29: diffuse grooves with one interreflection.
vec3 lf_oren_nayar_full(FreeDirection wi, FreeDirection wo, vec3 albedo, float sigma) {
    float sigma2 = sigma * sigma;
    float c1 = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33);
    float c2 = 0.45 * sigma2 / (sigma2 + 0.09);
    float c3 = 0.125 * sigma2 / (sigma2 + 0.09);
    float c4 = 0.17 * sigma2 / (sigma2 + 0.13);
    float sin_i = sqrt(dot(wi.along, wi.along));
    float sin_o = sqrt(dot(wo.along, wo.along));
    float elevation_i = lf_atan2(wi.cosine, sin_i) * 0.63661975;
    float elevation_o = lf_atan2(wo.cosine, sin_o) * 0.63661975;
    float higher = max(elevation_i, elevation_o);
    float lower_cos = min(wi.cosine, wo.cosine);
    float larger_cos = max(wi.cosine, wo.cosine);
    float larger_sin = max(sin_i, sin_o);
    float dot_xy = dot(wi.along, wo.along);
    float cos_phi = dot_xy / max(sin_i * sin_o, 1e-14);
    vec3 azimuth_i = wi.along / max(sin_i, 1e-14);
    vec3 azimuth_o = wo.along / max(sin_o, 1e-14);
    bool facing = dot_xy < 0.0;
    vec3 apart = azimuth_i + (facing ? azimuth_o : (-azimuth_o));
    float aside = 0.5 * dot(apart, apart);
    float forward = dot_xy / larger_cos;
    float gap = higher * (3.0 - higher * (3.0 - higher)) - lower_cos * lower_cos / (1.0 + larger_sin);
    float backward = dot_xy * gap / max(larger_cos * larger_sin, 1e-14);
    float tan_mean = (sin_i + sin_o) / (wi.cosine + wo.cosine);
    float smaller = 1.0 - higher;
    float product = smaller * (1.0 - min(elevation_i, elevation_o));
    float direct = c1 + c2 * (dot_xy >= 0.0 ? forward : backward);
    direct = direct + aside * c3 * (product * product) * tan_mean;
    float interreflected = c4 * (1.0 - cos_phi * (smaller * smaller));
    return albedo / 3.1415927 * max(direct + albedo * interreflected, 0.0);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    Crossing crossing = lf_pass_interface(lf_sealer_interface, lf_sealer.eta, lf_sealer.alpha, wi);
    Crossing crossing2 = lf_pass_interface(lf_sealer_interface, lf_sealer.eta, lf_sealer.alpha, wo);
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_sealer.eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float throughput = crossing.T * crossing2.T / (lf_sealer.eta * lf_sealer.eta);
    vec3 once = lf_sealer.tau + (crossing.path - 1.0) * (2.0 * lf_sealer.tau / (1.0 + lf_spread_root(crossing.theta, lf_sealer.tau)));
    vec3 throughput2 = throughput * exp(-(once + (lf_sealer.tau + (crossing2.path - 1.0) * (2.0 * lf_sealer.tau / (1.0 + lf_spread_root(crossing2.theta, lf_sealer.tau))))));
    vec3 value = F * lf_ggx_lobe(wi, wo, direction, lf_sealer.alpha) + throughput2 * lf_oren_nayar_full(FreeDirection(crossing.w_along, crossing.w_cosine), FreeDirection(crossing2.w_along, crossing2.w_cosine), lf_concrete.albedo, lf_concrete.sigma) / (1.0 - lf_concrete.albedo * lf_concrete_returned);
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
