#version 330 core
// coated_lens: Coat over Lambert.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: glass: absorption, glass: anisotropy.
// glass: under a film of 100 nm, whose colour in daylight is in its constants.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
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

struct Lambert {
    float albedo;  // part of the light that is sent back
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

struct Crossing {
    vec3 w_along;       // direction in the medium below: part along the surface, in any space
    float w_cosine;     // direction in the medium below: cosine to its normal
    vec3 T;             // energy that passes
    float spread;       // width of the refracted directions over that of the facets
    float lengthening;  // path beyond that of the refracted direction, in thicknesses
    float drift;        // the part of it due to grazing incidence
};

const Coat lf_glass = Coat(
    vec3(-0.06518905, -0.07896224, -0.09237827),            // film_0: f0 of the film, which depends on the angle, by Chebyshev polynomials of sqrt(c): degree 0
    vec3(0.13004999, 0.14349419, 0.16166191),               // film_1: degree 1
    vec3(-0.053404685, -0.053812753, -0.053872436),         // film_2: degree 2
    vec3(-0.008618194, -0.009638261, -0.010735792),         // film_3: degree 3
    vec3(0.012164612, 0.01251642, 0.013052918),             // film_4: degree 4
    vec3(-0.0002893512, -0.00016844738, 1.108041e-06),      // film_5: degree 5
    vec3(-0.0008593055, -0.00086547574, -0.0008843492),     // film_6: degree 6
    vec3(-0.00010244106, -0.00010235782, -0.000111718546),  // film_7: degree 7
    vec3(-6.021699e-05, -5.900953e-05, -6.0270773e-05),     // film_8: degree 8
    vec3(2.8896378e-05, 2.7528498e-05, 2.5437796e-05),      // film_9: degree 9
    0.02,                                                   // alpha: width of the facet slopes; the square of an artist's roughness
    1.52                                                    // eta: index of refraction, against air
);

const Interface lf_glass_interface = Interface(
    1.52,           // n: index of the medium below, against air
    0.02,           // alpha: width of the facets, mean of the axes
    0.0031546694,   // tilt: turn of the mean facet towards a grazing direction
    0.0015962153,   // gain: part of the reflected light that a second facet lets in
    0.00010532755,  // lengthening: path added by the spread of refracted directions, in thicknesses
    0.036961365     // drift: scale of the path added at grazing angles
);

const Lambert lf_black = Lambert(
    0.004   // albedo: part of the light that is sent back
);

const vec3 lf_black_returned = vec3(1.0023817, 1.0023729, 1.0023694);

// The cosine between either direction and their half vector.
float lf_half_cosine(FreeDirection wi, FreeDirection wo) {
    vec3 along = wi.along + wo.along;
    float cosine = wi.cosine + wo.cosine;
    return 0.5 * sqrt(dot(along, along) + cosine * cosine);
}

// The cosine on that side of a dielectric boundary where the index is lower; 0 under total internal reflection.
float lf_rarer_cosine(float c, float eta) {
    return c;
}

// sqrt(c) as -1 to 1, from where a film's polynomial begins.
float lf_chebyshev_argument(float c) {
    return max((2.0 * sqrt(c) - 1.06) / 0.94, -1.0);
}

// What Schlick's formula takes for f0 of a coat with a film, in daylight; `c` on the rarer side.
vec3 lf_film_on_coat(Coat coat, float c) {
    float s = lf_chebyshev_argument(c);
    vec3 total = coat.film_8 + 2.0 * s * coat.film_9;
    vec3 total2 = coat.film_7 + 2.0 * s * total - coat.film_9;
    total = coat.film_6 + 2.0 * s * total2 - total;
    total2 = coat.film_5 + 2.0 * s * total - total2;
    total = coat.film_4 + 2.0 * s * total2 - total;
    total2 = coat.film_3 + 2.0 * s * total - total2;
    total = coat.film_2 + 2.0 * s * total2 - total;
    total2 = coat.film_1 + 2.0 * s * total - total2;
    return coat.film_0 + s * total2 - total;
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

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(FreeDirection w, float tilt) {
    return sqrt(tilt + (1.0 - tilt) * (w.cosine * w.cosine));
}

// sqrt(c) as -1 to 1, from where a film's polynomial begins.
float lf_chebyshev_argument2(float c) {
    return (2.0 * sqrt(c) - 1.06) / 0.94;
}

// What Schlick's formula takes for f0 of a coat with a film, in daylight; `c` on the rarer side.
vec3 lf_film_on_coat2(Coat coat, float c) {
    float s = lf_chebyshev_argument2(c);
    vec3 total = coat.film_8 + 2.0 * s * coat.film_9;
    vec3 total2 = coat.film_7 + 2.0 * s * total - coat.film_9;
    total = coat.film_6 + 2.0 * s * total2 - total;
    total2 = coat.film_5 + 2.0 * s * total - total2;
    total = coat.film_4 + 2.0 * s * total2 - total;
    total2 = coat.film_3 + 2.0 * s * total - total2;
    total = coat.film_2 + 2.0 * s * total2 - total;
    total2 = coat.film_1 + 2.0 * s * total - total2;
    return coat.film_0 + s * total2 - total;
}

// Energy that passes a rough interface, from what passes the mean facet; `gain` is `second_facet`.
vec3 lf_with_second_facet(vec3 T, float gain) {
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
    vec3 t = lf_film_on_coat2(coat, c);
    vec3 below = 1.0 - min(max(lf_fresnel_schlick(c, t) * 200.0, 0.0), 1.0);
    vec3 T = lf_with_second_facet(min(max((1.0 - t) * (c * (5.0 - c * (10.0 - c * (10.0 - c * (5.0 - c))))), 0.0), 1.0) - 0.0025 * (below * below), interface_.gain);
    float grazing = lf_drift(w, interface_.drift, interface_.alpha);
    FreeDirection below2 = lf_refract_about_normal(air, interface_.n);
    return Crossing(below2.along, below2.cosine, T, lf_slope_spread(c, coat.eta), interface_.lengthening + grazing, grazing);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float c = lf_rarer_cosine(lf_half_cosine(wi, wo), lf_glass.eta);
    vec3 reflected = lf_fresnel_schlick(c, lf_film_on_coat(lf_glass, c));
    vec3 below = 1.0 - min(max(reflected * 200.0, 0.0), 1.0);
    vec3 F = min(max(reflected, 0.0), 1.0) + 0.0025 * (below * below);
    FreeDirection direction = lf_half_vector(wi, wo);
    vec3 f = F * lf_ggx_lobe(wi, wo, direction, lf_glass.alpha);
    Crossing i = lf_cross(lf_glass_interface, lf_glass, wi, wi);
    Crossing o = lf_cross(lf_glass_interface, lf_glass, wo, wo);
    vec3 throughput = i.T * o.T / (lf_glass.eta * lf_glass.eta);
    reflected = lf_black.albedo / 3.1415927 * lf_black_returned;
    f = f + throughput * reflected;
    return lit ? f : vec3(0.0);
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
