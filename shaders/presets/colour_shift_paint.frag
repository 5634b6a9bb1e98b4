#version 330 core
// colour_shift_paint: Coat over Conductor.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: clear_coat: absorption, clear_coat: anisotropy, pigment: anisotropy.
// Indices of refraction are relative to the layer above: its own index divides those in the preset.
// pigment: under a film of 335 nm, whose colour in daylight is in its constants.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    float eta;    // index of refraction, against air
};

struct Interface {
    float n;            // index of the medium below, against air
    float alpha;        // width of the facets, mean of the axes
    float tilt;         // turn of the mean facet towards a grazing direction
    float gain;         // part of the reflected light that a second facet lets in
    float lengthening;  // path added by the spread of refracted directions, in thicknesses
    float drift;        // scale of the path added at grazing angles
};

struct Conductor {
    vec3 film_0;  // f0 of the film, which depends on the angle, by Chebyshev polynomials of sqrt(c): degree 0
    vec3 film_1;  // degree 1
    vec3 film_2;  // degree 2
    vec3 film_3;  // degree 3
    vec3 film_4;  // degree 4
    vec3 film_5;  // degree 5
    vec3 film_6;  // degree 6
    vec3 film_7;  // degree 7
    vec3 film_8;  // degree 8
    vec3 film_9;  // degree 9
    float alpha;  // width of the facet slopes; the square of an artist's roughness
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

struct Crossing {
    vec3 w_along;       // direction in the medium below: part along the surface, in any space
    float w_cosine;     // direction in the medium below: cosine to its normal
    float T;            // energy that passes
    float spread;       // width of the refracted directions over that of the facets
    float lengthening;  // path beyond that of the refracted direction, in thicknesses
    float drift;        // the part of it due to grazing incidence
};

const Coat lf_clear_coat = Coat(
    0.02,  // alpha: width of the facet slopes; the square of an artist's roughness
    1.5    // eta: index of refraction, against air
);

const Interface lf_clear_coat_interface = Interface(
    1.5,            // n: index of the medium below, against air
    0.02,           // alpha: width of the facets, mean of the axes
    0.0031546694,   // tilt: turn of the mean facet towards a grazing direction
    0.0015962153,   // gain: part of the reflected light that a second facet lets in
    0.00010262683,  // lengthening: path added by the spread of refracted directions, in thicknesses
    0.036786783     // drift: scale of the path added at grazing angles
);

const Conductor lf_pigment = Conductor(
    vec3(-0.03177993, 0.31624234, 0.13399988),         // film_0: f0 of the film, which depends on the angle, by Chebyshev polynomials of sqrt(c): degree 0
    vec3(0.42350492, 0.014318556, 0.27886057),         // film_1: degree 1
    vec3(-0.36459565, 0.0691672, -0.16119578),         // film_2: degree 2
    vec3(-0.002379112, 0.06440999, -0.07279192),       // film_3: degree 3
    vec3(0.10255003, 0.013990443, 0.001401905),        // film_4: degree 4
    vec3(0.03703741, -0.02010179, 0.014054302),        // film_5: degree 5
    vec3(0.018969845, -0.018768594, 0.021412754),      // film_6: degree 6
    vec3(-0.002981767, -0.0048232228, 0.00911553),     // film_7: degree 7
    vec3(-0.0065035634, 0.0006227121, 0.0028100368),   // film_8: degree 8
    vec3(-0.0034358278, 0.0022315942, -0.0022205412),  // film_9: degree 9
    0.2                                                // alpha: width of the facet slopes; the square of an artist's roughness
);

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

// Path added near grazing angles, where the facets that face the light take most of it.
float lf_drift(FreeDirection w, float scale, float alpha) {
    float one_minus = 1.0 - w.cosine;
    return scale * exp(3.16 * log(max(one_minus, 1e-30)) - 7.0 * alpha * one_minus);
}

// Direction below a boundary of relative index `eta` (Snell's law); its z is 0 under total internal reflection.
FreeDirection lf_refract_about_normal(FreeDirection w, float eta) {
    float z2 = (eta - 1.0) * (eta + 1.0) + w.cosine * w.cosine;
    float inverse = 1.0 / eta;
    return FreeDirection(w.along * inverse, sqrt(z2) * inverse);
}

// Width of the refracted directions over the width of the facets, to first order in slope.
float lf_slope_spread(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g = sqrt(delta + c * c);
    return 0.5 * delta / (g * (g + c));
}

// Follow one direction through the rough top of a coat with its relative index; `air` is the direction above all of them.
Crossing lf_cross(Interface interface_, Coat coat, FreeDirection w, FreeDirection air) {
    float c = lf_facet_cosine(w, interface_.tilt);
    float T = lf_with_second_facet(lf_transmittance_dielectric(c, coat.eta), interface_.gain);
    float grazing = lf_drift(w, interface_.drift, interface_.alpha);
    FreeDirection below = lf_refract_about_normal(air, interface_.n);
    return Crossing(below.along, below.cosine, T, lf_slope_spread(c, coat.eta), interface_.lengthening + grazing, grazing);
}

// Turn a direction, azimuth kept, until its path 1 / w.z is longer by `lengthening`.
FreeDirection lf_steer(FreeDirection w, float lengthening) {
    float z = w.cosine / (1.0 + lengthening * w.cosine);
    float growth = lengthening * z * w.cosine * (w.cosine + z) / max(dot(w.along, w.along), 1e-14);
    float ratio = sqrt(1.0 + growth);
    return FreeDirection(w.along * ratio, z);
}

// sqrt(c) as -1 to 1, from where a film's polynomial begins.
float lf_chebyshev_argument(float c) {
    return max((2.0 * sqrt(c) - 1.06) / 0.94, -1.0);
}

// What Schlick's formula takes for f0 of a metal with a film, in daylight.
vec3 lf_film_on_metal(Conductor base, float c) {
    float s = lf_chebyshev_argument(c);
    vec3 total = base.film_8 + 2.0 * s * base.film_9;
    vec3 total2 = base.film_7 + 2.0 * s * total - base.film_9;
    total = base.film_6 + 2.0 * s * total2 - total;
    total2 = base.film_5 + 2.0 * s * total - total2;
    total = base.film_4 + 2.0 * s * total2 - total;
    total2 = base.film_3 + 2.0 * s * total - total2;
    total = base.film_2 + 2.0 * s * total2 - total;
    total2 = base.film_1 + 2.0 * s * total - total2;
    return base.film_0 + s * total2 - total;
}

// Schlick 1994, eq. 15, from the reflectance at normal incidence.
vec3 lf_fresnel_schlick(float c, vec3 f0) {
    float m = 1.0 - c;
    float m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
}

// Part of a lobe of width alpha that leaves the escape cone: sine in air, cosine in the medium of index n.
float lf_edge_reflection(float sine, float cosine, float n, float alpha) {
    float rise = 1.0 - sine;
    float width = 2.0 * alpha * n * cosine;
    return 0.5 - 0.5 * rise / sqrt(width * width + rise * rise);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_clear_coat.eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float f = F * lf_ggx_lobe(wi, wo, direction, lf_clear_coat.alpha);
    Crossing i = lf_cross(lf_clear_coat_interface, lf_clear_coat, wi, wi);
    Crossing o = lf_cross(lf_clear_coat_interface, lf_clear_coat, wo, wo);
    float throughput = i.T * o.T / (lf_clear_coat.eta * lf_clear_coat.eta);
    float sin_i = sqrt(dot(wi.along, wi.along));
    float sin_o = sqrt(dot(wo.along, wo.along));
    float R_i = 1.0 - i.T;
    float R_o = 1.0 - o.T;
    wi = lf_steer(FreeDirection(i.w_along, i.w_cosine), 0.5 * i.drift);
    wo = lf_steer(FreeDirection(o.w_along, o.w_cosine), 0.5 * o.drift);
    FreeDirection h = lf_half_vector(wi, wo);
    float t = lf_half_cosine(wi, wo);
    vec3 reflected = lf_fresnel_schlick(t, lf_film_on_metal(lf_pigment, t));
    vec3 below = 1.0 - min(max(reflected * 200.0, 0.0), 1.0);
    vec3 F2 = min(max(reflected, 0.0), 1.0) + 0.0025 * (below * below);
    float R = 0.5 * (R_i + R_o);
    float edge_i = lf_edge_reflection(sin_i, i.w_cosine, lf_clear_coat_interface.n, lf_pigment.alpha);
    float edge_o = lf_edge_reflection(sin_o, o.w_cosine, lf_clear_coat_interface.n, lf_pigment.alpha);
    vec3 q = F2 * (R + (1.0 - R) * (0.5 * (edge_i + edge_o)));
    float spread = (pow(i.spread, 1.34) + pow(o.spread, 1.34)) * pow(lf_clear_coat.alpha, 1.34);
    float total = spread + 3.0 * pow(lf_pigment.alpha, 1.34);
    total = total + 2.0 * pow(lf_clear_coat.alpha, 1.34);
    float width = pow(total, 0.74626863);
    float lobe = lf_ggx_lobe(wi, wo, h, width);
    vec3 lobes = lobe / max(1.0 - q, 1e-06);
    total = spread + 2.0 * pow(lf_pigment.alpha, 1.34);
    total = total + pow(lf_clear_coat.alpha, 1.34);
    width = pow(total, 0.74626863);
    lobe = lf_ggx_lobe(wi, wo, h, width);
    lobes = lobe + q * lobes;
    total = spread + pow(lf_pigment.alpha, 1.34);
    width = pow(total, 0.74626863);
    lobe = lf_ggx_lobe(wi, wo, h, width);
    lobes = lobe + q * lobes;
    vec3 f2 = f + throughput * F2 * lobes;
    return lit ? f2 : vec3(0.0);
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
