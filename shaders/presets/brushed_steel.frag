#version 330 core
// brushed_steel: Conductor.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat.
//
// vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Conductor {
    float alpha_x;  // width of the facet slopes along the tangent; the square of an artist's roughness
    float alpha_y;  // width of the facet slopes across the tangent; the square of an artist's roughness
    vec3 eta;       // index of refraction, real part
    vec3 k;         // index of refraction, imaginary part
};

const Conductor lf_steel = Conductor(
    0.08,                       // alpha_x: width of the facet slopes along the tangent; the square of an artist's roughness
    0.3,                        // alpha_y: width of the facet slopes across the tangent; the square of an artist's roughness
    vec3(2.911, 2.95, 2.585),   // eta: index of refraction, real part
    vec3(3.089, 2.932, 2.767)   // k: index of refraction, imaginary part
);

// The cosine between either direction and their half vector.
float lf_half_cosine(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return 0.5 * sqrt(dot(s, s));
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor(float c, vec3 eta, vec3 k) {
    float c2 = c * c;
    float s2 = 1.0 - c2;
    vec3 p = (eta - k) * (eta + k) - 1.0 + c2;
    vec3 nk2 = 2.0 * eta * k;
    vec3 q = sqrt(p * p + nk2 * nk2);
    vec3 larger = sqrt(q + abs(p));
    bvec3 metal = lessThan(p, vec3(0.0));
    vec3 b = mix(vec3(1.0), larger, metal);
    vec3 twice_abc = 1.4142135 * mix(larger, nk2, metal) * c;
    vec3 even = b * (q * c2 + s2 * s2);
    vec3 odd = twice_abc * s2;
    vec3 across = b * (q + c2);
    return (across - twice_abc) * even / ((across + twice_abc) * (even + odd));
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

// BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine.
vec3 lf_evaluate(vec3 wi, vec3 wo) {
    bool lit = min(wi.z, wo.z) > 1e-07;
    vec3 F = lf_fresnel_conductor(lf_half_cosine(wi, wo), lf_steel.eta, lf_steel.k);
    float D = lf_ggx_d_anisotropic(lf_half_vector(wi, wo), lf_steel.alpha_x, lf_steel.alpha_y);
    float projection_i = lf_ggx_projection_anisotropic(wi, lf_steel.alpha_x, lf_steel.alpha_y);
    float projection_o = lf_ggx_projection_anisotropic(wo, lf_steel.alpha_x, lf_steel.alpha_y);
    float V = lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    vec3 value = F * (D * V);
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
