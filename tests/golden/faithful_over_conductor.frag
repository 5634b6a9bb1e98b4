#version 330 core
// faithful over conductor: Coat over Conductor.
// Printed by layerfit 0.1.0 from its faithful form.
// Left out, because this material does without: coat: anisotropy, base: anisotropy.
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

struct Conductor {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

const Coat lf_coat = Coat(
    0.1,                   // alpha: width of the facet slopes; the square of an artist's roughness
    1.5,                   // eta: index of refraction, against air
    vec3(0.05, 0.2, 0.6)   // tau: optical depth, one way at normal incidence
);

const Conductor lf_base = Conductor(
    0.2,                                // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(0.134, 0.616, 0.73466665),     // eta: index of refraction, real part
    vec3(2.6086667, 1.6353334, 1.428)   // k: index of refraction, imaginary part
);

// The unit vector halfway between two directions on the same side of the surface.
FreeDirection lf_half_vector(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    float inverse = inversesqrt(dot(along, along) + cosine * cosine);
    return FreeDirection(along * inverse, cosine * inverse);
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

// GGX density of facet normals (Walter et al. 2007, eq. 33).
float lf_ggx_d(FreeDirection h, float alpha) {
    float root = alpha * 0.5641896 / (dot(h.along, h.along) + alpha * alpha * (h.cosine * h.cosine));
    return root * root;
}

// G / (4 NoL NoV), V-shaped grooves (Torrance and Sparrow 1967; Cook and Torrance 1982, eq. 10).
float lf_v_cavity(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    float NoH_over_c = 2.0 * cosine / (dot(along, along) + cosine * cosine);
    return min(0.25 / max(wi.cosine * wo.cosine, 1e-14), 0.5 * NoH_over_c / max(wi.cosine, wo.cosine));
}

// Cosine below a boundary of relative index `eta` (Snell's law); 0 under total internal reflection.
float lf_cosine_below(float c, float eta) {
    return sqrt((eta - 1.0) * (eta + 1.0) + c * c) * (1.0 / eta);
}

// Direction below a facet with normal `h`, c = w.h (Elek 2010 after Weidlich and Wilkie 2007); z may be <= 0.
FreeDirection lf_refract_about_facet(FreeDirection w, FreeDirection h, float c, float c_below, float eta) {
    float inverse = 1.0 / eta;
    float turn = c_below - c * inverse;
    vec3 along = w.along * inverse + h.along * turn;
    float cosine = w.cosine * inverse + h.cosine * turn;
    return FreeDirection(along, cosine);
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

// Bouguer, Lambert and Beer: what remains after `path` times the optical depth at normal incidence.
vec3 lf_transmittance(vec3 tau, float path) {
    return exp(-tau * path);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    FreeDirection h = lf_half_vector(wi, wo);
    float c = lf_half_cosine(wi, wo);
    float F = lf_fresnel_dielectric(c, lf_coat.eta);
    float D = lf_ggx_d(h, lf_coat.alpha);
    float V = lf_v_cavity(wi, wo);
    float top = F * V * D;
    float c_below = lf_cosine_below(c, lf_coat.eta);
    FreeDirection wi_below = lf_refract_about_facet(wi, h, c, c_below, lf_coat.eta);
    FreeDirection wo_below = lf_refract_about_facet(wo, h, c, c_below, lf_coat.eta);
    float T12 = lf_transmittance_dielectric(c, lf_coat.eta);
    float t = 1.0 - 4.0 * wi.cosine * (F * V * wo.cosine);
    bool lit2 = min(wi_below.cosine, wo_below.cosine) > 1e-07;
    vec3 rest = T12 * t * (lf_fresnel_conductor(c_below, lf_base.eta, lf_base.k) * lf_ggx_lobe(wi_below, wo_below, h, lf_base.alpha));
    float path = (wi_below.cosine + wo_below.cosine) / (wi_below.cosine * wo_below.cosine);
    rest = rest * lf_transmittance(lf_coat.tau, path);
    vec3 value = top + rest;
    value = lit2 ? value : vec3(top);
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
