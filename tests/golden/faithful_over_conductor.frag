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
vec3 lf_half_vector(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return s / sqrt(max(dot(s, s), 1e-20));
}

// The cosine between either direction and their half vector.
float lf_half_cosine(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return min(0.5 * sqrt(max(dot(s, s), 0.0)), 1.0);
}

// Exact reflectance of a dielectric boundary (Born and Wolf 1999, 1.5.2); 1 under total internal reflection.
float lf_fresnel_dielectric(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g2 = delta + c * c;
    bool refracts = g2 > 1e-08;
    float g = sqrt(refracts ? g2 : 1.0);
    float eta2 = eta * eta;
    float perpendicular = (c + g) * (c + g);
    float parallel = (eta2 * c + g) * (eta2 * c + g);
    float rs = -delta / perpendicular;
    float rp = delta * ((eta2 + 1.0) * c * c - 1.0) / parallel;
    float reflectance = 0.5 * (rs * rs + rp * rp);
    return eta == 1.0 ? 0.0 : (refracts ? reflectance : 1.0);
}

// GGX density of facet normals (Walter et al. 2007, eq. 33).
float lf_ggx_d(vec3 h, float alpha) {
    float e = (h.x * h.x + h.y * h.y) / (alpha * alpha) + h.z * h.z;
    float root = 1.0 / (e * alpha);
    return root * root / 3.1415927;
}

// G / (4 NoL NoV), V-shaped grooves (Torrance and Sparrow 1967; Cook and Torrance 1982, eq. 10).
float lf_v_cavity(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    float NoH_over_c = 2.0 * s.z / max(dot(s, s), 1e-20);
    return min(0.25 / max(wi.z * wo.z, 1e-14), 0.5 * NoH_over_c / max(max(wi.z, wo.z), 1e-14));
}

// Cosine below a boundary of relative index `eta` (Snell's law); 0 under total internal reflection.
float lf_cosine_below(float c, float eta) {
    return sqrt(max((eta - 1.0) * (eta + 1.0) + c * c, 0.0)) / eta;
}

// Direction below a facet with normal `h`, c = w.h (Elek 2010 after Weidlich and Wilkie 2007); z may be <= 0.
vec3 lf_refract_about_facet(vec3 w, vec3 h, float c, float c_below, float eta) {
    return w / eta + (c_below - c / eta) * h;
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric(float c, float eta) {
    float g = sqrt(max((eta - 1.0) * (eta + 1.0) + c * c, 0.0));
    float eta2 = eta * eta;
    float perpendicular = c + g;
    float parallel = eta2 * c + g;
    float product = 2.0 * c * g;
    float passed = product / max(perpendicular * perpendicular, 1e-14) + product * eta2 / max(parallel * parallel, 1e-14);
    return eta == 1.0 ? 1.0 : passed;
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor(float c, vec3 eta, vec3 k) {
    float c2 = c * c;
    float s2 = (1.0 - c) * (1.0 + c);
    vec3 p = (eta - k) * (eta + k) - s2;
    vec3 nk = eta * k;
    vec3 q = sqrt(max(p * p + 4.0 * nk * nk, 1e-24));
    vec3 larger = sqrt(0.5 * (q + abs(p)));
    vec3 a = mix(larger, nk / larger, lessThan(p, vec3(0.0)));
    vec3 twice_ac = 2.0 * a * c;
    vec3 rs = (q + c2 - twice_ac) / max(q + c2 + twice_ac, 1e-12);
    float s4 = s2 * s2;
    vec3 even = q * c2 + s4;
    vec3 odd = twice_ac * s2;
    vec3 rp = rs * (even - odd) / max(even + odd, 1e-12);
    return 0.5 * (rs + rp);
}

// NoW (1 + 2 Lambda) of the GGX distribution (Heitz 2014, eq. 72, multiplied out).
float lf_ggx_projection(vec3 w, float alpha) {
    return sqrt(max(w.z * w.z + alpha * alpha * (w.x * w.x + w.y * w.y), 0.0));
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / max(NoV * projection_l + NoL * projection_v, 1e-14);
}

// Bouguer, Lambert and Beer: what remains after `path` times the optical depth at normal incidence.
vec3 lf_transmittance(vec3 tau, float path) {
    return exp(-(tau * path));
}

// BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine.
vec3 lf_evaluate(vec3 wi, vec3 wo) {
    bool lit = wi.z > 0.0 && wo.z > 0.0;
    wi = lit ? wi : vec3(0.0, 0.0, 1.0);
    wo = lit ? wo : vec3(0.0, 0.0, 1.0);
    vec3 h = lf_half_vector(wi, wo);
    float c = lf_half_cosine(wi, wo);
    float F = lf_fresnel_dielectric(c, lf_coat.eta);
    float D = lf_ggx_d(h, lf_coat.alpha);
    float V = lf_v_cavity(wi, wo);
    float top = F * D * V;
    float G = 4.0 * V * wi.z * wo.z;
    float c_below = lf_cosine_below(c, lf_coat.eta);
    vec3 wi_below = lf_refract_about_facet(wi, h, c, c_below, lf_coat.eta);
    vec3 wo_below = lf_refract_about_facet(wo, h, c, c_below, lf_coat.eta);
    float T12 = lf_transmittance_dielectric(c, lf_coat.eta);
    float t = 1.0 - G + T12 * G;
    bool lit2 = wi_below.z > 0.0 && wo_below.z > 0.0;
    wi = lit2 ? wi_below : vec3(0.0, 0.0, 1.0);
    wo = lit2 ? wo_below : vec3(0.0, 0.0, 1.0);
    D = lf_ggx_d(h, lf_base.alpha);
    float projection_i = lf_ggx_projection(wi, lf_base.alpha);
    float projection_o = lf_ggx_projection(wo, lf_base.alpha);
    V = lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    vec3 rest = T12 * t * (lit2 ? lf_fresnel_conductor(c_below, lf_base.eta, lf_base.k) * (D * V) : vec3(0.0));
    float path = 1.0 / max(wi_below.z, 1e-14) + 1.0 / max(wo_below.z, 1e-14);
    rest = rest * lf_transmittance(lf_coat.tau, path);
    vec3 f = top + rest;
    return lit ? f : vec3(0.0);
}

// BRDF [1/sr] in any frame.
vec3 lf_brdf(vec3 n, vec3 v, vec3 l) {
    // A tangent frame from the normal alone (Duff et al. 2017): an isotropic surface does not ask which.
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    mat3 surface = transpose(mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n));
    return lf_evaluate(surface * l, surface * v);
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
