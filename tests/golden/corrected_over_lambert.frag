#version 330 core
// corrected over lambert: Coat over Lambert.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat: anisotropy.
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
    float n;            // index of the medium below, against air
    float alpha;        // width of the facets, mean of the axes
    float tilt;         // turn of the mean facet towards a grazing direction
    float gain;         // part of the reflected light that a second facet lets in
    float lengthening;  // path added by the spread of refracted directions, in thicknesses
    float drift;        // scale of the path added at grazing angles
};

struct Lambert {
    vec3 albedo;  // part of the light that is sent back
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

const Coat lf_coat = Coat(
    0.1,                   // alpha: width of the facet slopes; the square of an artist's roughness
    1.5,                   // eta: index of refraction, against air
    vec3(0.05, 0.2, 0.6)   // tau: optical depth, one way at normal incidence
);

const Interface lf_coat_interface = Interface(
    1.5,           // n: index of the medium below, against air
    0.1,           // alpha: width of the facets, mean of the axes
    0.024779005,   // tilt: turn of the mean facet towards a grazing direction
    0.036722906,   // gain: part of the reflected light that a second facet lets in
    0.0025420089,  // lengthening: path added by the spread of refracted directions, in thicknesses
    0.62499845     // drift: scale of the path added at grazing angles
);

const Lambert lf_base = Lambert(
    vec3(0.5, 0.28, 0.13)   // albedo: part of the light that is sent back
);

const vec3 lf_base_returned = vec3(1.3041564, 1.076677, 1.008228);

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

// Bouguer, Lambert and Beer: what remains after `path` times the optical depth at normal incidence.
vec3 lf_transmittance(vec3 tau, float path) {
    return exp(-tau * path);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_coat.eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float f = F * lf_ggx_lobe(wi, wo, direction, lf_coat.alpha);
    Crossing i = lf_cross(lf_coat_interface, lf_coat, wi, wi);
    Crossing o = lf_cross(lf_coat_interface, lf_coat, wo, wo);
    float throughput = i.T * o.T / (lf_coat.eta * lf_coat.eta);
    float straight = (i.w_cosine + o.w_cosine) / (i.w_cosine * o.w_cosine);
    float added = i.lengthening + o.lengthening;
    vec3 diffuse = lf_transmittance(lf_coat.tau, straight + added);
    vec3 reflected = lf_base.albedo / 3.1415927 * lf_base_returned;
    vec3 f2 = f + throughput * diffuse * reflected;
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
