#version 330 core
// anodised_titanium_teal: Conductor.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat, titanium: anisotropy.
// titanium: under a film of 192 nm, whose colour in daylight is in its constants.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

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

const Conductor lf_titanium = Conductor(
    vec3(0.06468588, 0.4151048, -0.007059455),           // film_0: f0 of the film, which depends on the angle, by Chebyshev polynomials of sqrt(c): degree 0
    vec3(-0.032735363, 0.0579755, 0.78521),              // film_1: degree 1
    vec3(-0.06307143, 0.07561727, -0.40846056),          // film_2: degree 2
    vec3(0.03989901, 0.0007843599, 0.025954694),         // film_3: degree 3
    vec3(0.02338681, 0.0006728731, 0.028966688),         // film_4: degree 4
    vec3(0.00017743371, 0.001062043, -0.026684895),      // film_5: degree 5
    vec3(0.000652052, -0.0027594678, 0.009991925),       // film_6: degree 6
    vec3(-0.00094941445, 0.00026642904, -0.0017305613),  // film_7: degree 7
    vec3(-0.0002239733, 5.2448362e-05, -0.0003270246),   // film_8: degree 8
    vec3(4.2555854e-05, 1.3396144e-05, 0.00037875772),   // film_9: degree 9
    0.25                                                 // alpha: width of the facet slopes; the square of an artist's roughness
);

// The cosine between either direction and their half vector.
float lf_half_cosine(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    return 0.5 * sqrt(dot(along, along) + cosine * cosine);
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

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float t = lf_half_cosine(wi, wo);
    vec3 reflected = lf_fresnel_schlick(t, lf_film_on_metal(lf_titanium, t));
    vec3 below = 1.0 - min(max(reflected * 200.0, 0.0), 1.0);
    vec3 F = min(max(reflected, 0.0), 1.0) + 0.0025 * (below * below);
    FreeDirection direction = lf_half_vector(wi, wo);
    vec3 value = F * lf_ggx_lobe(wi, wo, direction, lf_titanium.alpha);
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
