#version 330 core
// car_paint_opel_titan: CarPaint.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct CarPaint {
    vec3 kd;        // diffuse part
    vec3 ks;        // strength of the lobe
    float f0;       // reflectance of its facets at the normal
    float alpha;    // width of the facet slopes of the lobe; the square of an artist's roughness
    vec3 ks_2;      // strength of the lobe
    float f0_2;     // reflectance of its facets at the normal
    float alpha_2;  // width of the facet slopes of the second lobe; the square of an artist's roughness
    vec3 ks_3;      // strength of the lobe
    float f0_3;     // reflectance of its facets at the normal
    float alpha_3;  // width of the facet slopes of the third lobe; the square of an artist's roughness
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

const CarPaint lf_paint = CarPaint(
    vec3(0.011, 0.013, 0.015),   // kd: diffuse part
    vec3(0.057, 0.066, 0.078),   // ks: strength of the lobe
    0.85,                        // f0: reflectance of its facets at the normal
    0.38,                        // alpha: width of the facet slopes of the lobe; the square of an artist's roughness
    vec3(0.11, 0.12, 0.13),      // ks_2: strength of the lobe
    0.86,                        // f0_2: reflectance of its facets at the normal
    0.17,                        // alpha_2: width of the facet slopes of the second lobe; the square of an artist's roughness
    vec3(0.0095, 0.014, 0.016),  // ks_3: strength of the lobe
    0.9,                         // f0_3: reflectance of its facets at the normal
    0.014                        // alpha_3: width of the facet slopes of the third lobe; the square of an artist's roughness
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

// Schlick 1994, eq. 15, from the reflectance at normal incidence.
float lf_fresnel_schlick(float c, float f0) {
    float m = 1.0 - c;
    float m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
}

// G / (4 NoL NoV), V-shaped grooves (Torrance and Sparrow 1967; Cook and Torrance 1982, eq. 10).
float lf_v_cavity(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    float NoH_over_c = 2.0 * cosine / (dot(along, along) + cosine * cosine);
    return min(0.25 / max(wi.cosine * wo.cosine, 1e-14), 0.5 * NoH_over_c / max(wi.cosine, wo.cosine));
}

// Beckmann density of facet normals (Cook and Torrance 1982, eq. 14, normalised).
float lf_beckmann_d(FreeDirection h, float alpha) {
    bool above = h.cosine > 1e-04;
    float value = h.cosine * h.cosine;
    float inverse = 1.0 / (above ? value : 1.0);
    value = exp(-(dot(h.along, h.along) / (alpha * alpha)) * inverse) * (inverse * inverse) / (3.1415927 * (alpha * alpha));
    return above ? value : 0.0;
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    FreeDirection h = lf_half_vector(wi, wo);
    float c = lf_half_cosine(wi, wo);
    float V = lf_v_cavity(wi, wo);
    float D = lf_beckmann_d(h, lf_paint.alpha);
    float V2 = lf_v_cavity(wi, wo);
    float D2 = lf_beckmann_d(h, lf_paint.alpha_2);
    float V3 = lf_v_cavity(wi, wo);
    float D3 = lf_beckmann_d(h, lf_paint.alpha_3);
    vec3 value = 4.0 * lf_paint.ks * lf_fresnel_schlick(c, lf_paint.f0) * (D * V) + 4.0 * lf_paint.ks_2 * lf_fresnel_schlick(c, lf_paint.f0_2) * (D2 * V2) + 4.0 * lf_paint.ks_3 * lf_fresnel_schlick(c, lf_paint.f0_3) * (D3 * V3) + lf_paint.kd / 3.1415927;
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
