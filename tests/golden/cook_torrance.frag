#version 330 core
// cook_torrance: CookTorrance.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat, base: anisotropy.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct CookTorrance {
    vec3 kd;      // diffuse part
    float ks;     // part of the surface that is facets
    float alpha;  // width of the facet slopes, the paper's m; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

const CookTorrance lf_base = CookTorrance(
    vec3(0.05, 0.02, 0.01),     // kd: diffuse part
    0.9,                        // ks: part of the surface that is facets
    0.25,                       // alpha: width of the facet slopes, the paper's m; the square of an artist's roughness
    vec3(0.201, 0.924, 1.102),  // eta: index of refraction, real part
    vec3(3.913, 2.453, 2.142)   // k: index of refraction, imaginary part
);

// The cosine between either direction and their half vector.
float lf_half_cosine(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    return 0.5 * sqrt(dot(along, along) + cosine * cosine);
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

// The unit vector halfway between two directions on the same side of the surface.
FreeDirection lf_half_vector(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    float inverse = inversesqrt(dot(along, along) + cosine * cosine);
    return FreeDirection(along * inverse, cosine * inverse);
}

// Beckmann density of facet normals (Cook and Torrance 1982, eq. 14, normalised).
float lf_beckmann_d(FreeDirection h, float alpha) {
    bool above = h.cosine > 1e-04;
    float value = h.cosine * h.cosine;
    float inverse = 1.0 / (above ? value : 1.0);
    value = exp(-(dot(h.along, h.along) / (alpha * alpha)) * inverse) * (inverse * inverse) / (3.1415927 * (alpha * alpha));
    return above ? value : 0.0;
}

// G / (4 NoL NoV), V-shaped grooves (Torrance and Sparrow 1967; Cook and Torrance 1982, eq. 10).
float lf_v_cavity(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    float NoH_over_c = 2.0 * cosine / (dot(along, along) + cosine * cosine);
    return min(0.25 / max(wi.cosine * wo.cosine, 1e-14), 0.5 * NoH_over_c / max(wi.cosine, wo.cosine));
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    vec3 F = lf_base.ks * lf_fresnel_conductor(lf_half_cosine(wi, wo), lf_base.eta, lf_base.k);
    FreeDirection direction = lf_half_vector(wi, wo);
    float D = lf_beckmann_d(direction, lf_base.alpha);
    float V = lf_v_cavity(wi, wo);
    vec3 f = F * (D * V);
    vec3 value = f + lf_base.kd / 3.1415927;
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
