#version 330 core
// red_urushi: Coat over Lambert.
// Printed by layerfit 0.1.0 from its precise form.
// Left out, because this material does without: urushi: anisotropy.
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

struct Lambert {
    vec3 albedo;  // part of the light that is sent back
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

const Coat lf_urushi = Coat(
    0.04,                  // alpha: width of the facet slopes; the square of an artist's roughness
    1.53,                  // eta: index of refraction, against air
    vec3(0.08, 0.3, 0.6)   // tau: optical depth, one way at normal incidence
);

const Interface lf_urushi_interface = Interface(
    0.008038055,                                                  // tilt: turn of the mean facet towards a grazing direction
    0.006316437,                                                  // gain: part of the reflected light that a second facet lets in
    vec4(-0.019861361, 0.03569795, -0.021563128, 0.00021134847),  // passed: energy that passes, beyond the closed form: four coefficients
    vec2(0.018127924, -0.0131169055),                             // passed_high: the other two, of higher powers
    vec4(0.33833733, 0.014788263, -0.011239186, 0.008833408),     // bend: part by which the sine of light becomes smaller below
    vec2(-0.008969933, 0.0041354),                                // bend_high
    vec4(0.60856783, -0.24872911, 0.17404774, -0.3165228),        // spread: width of a lobe seen through it, over that of the facets
    vec2(0.12010063, -0.025424272),                               // spread_high
    vec4(1.0290464, -0.06173104, 0.06664726, -0.05434048),        // path: mean path over that of the refracted direction
    vec2(0.015009224, 0.0062069893),                              // path_high
    vec4(0.06297798, -0.1371728, 0.16691335, -0.22109175),        // theta: scale of the path's distribution
    vec2(0.1095863, 0.037178833)                                  // theta_high
);

const Lambert lf_cinnabar = Lambert(
    vec3(0.58, 0.07, 0.03)   // albedo: part of the light that is sent back
);

const vec3 lf_cinnabar_returned = vec3(0.4255121, 0.18577918, 0.06779366);

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

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    Crossing crossing = lf_pass_interface(lf_urushi_interface, lf_urushi.eta, lf_urushi.alpha, wi);
    Crossing crossing2 = lf_pass_interface(lf_urushi_interface, lf_urushi.eta, lf_urushi.alpha, wo);
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_urushi.eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float throughput = crossing.T * crossing2.T / (lf_urushi.eta * lf_urushi.eta);
    vec3 once = lf_urushi.tau + (crossing.path - 1.0) * (2.0 * lf_urushi.tau / (1.0 + lf_spread_root(crossing.theta, lf_urushi.tau)));
    vec3 throughput2 = throughput * exp(-(once + (lf_urushi.tau + (crossing2.path - 1.0) * (2.0 * lf_urushi.tau / (1.0 + lf_spread_root(crossing2.theta, lf_urushi.tau))))));
    vec3 value = F * lf_ggx_lobe(wi, wo, direction, lf_urushi.alpha) + throughput2 * (lf_cinnabar.albedo / 3.1415927) / (1.0 - lf_cinnabar.albedo * lf_cinnabar_returned);
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
