#version 330 core
// celadon_glaze: Coat over Lambert.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: glaze: anisotropy.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    float eta;    // index of refraction, against air
    vec3 tau;     // optical depth, one way at normal incidence
    float tau_s;  // optical depth of scattering, beside that of absorption
    float g;      // mean cosine of scattering: forwards above 0, backwards below; absent, the same in all directions
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

struct Haze {
    vec3 reduced;        // optical depth, with light scattered forwards taken as not scattered
    vec3 between;        // the same, with light scattered forwards twice
    vec3 upper_upper;    // light that goes on to and fro and stays within the upper third
    vec3 upper_middle;   // that goes from the upper to the middle third, or back
    vec3 upper_lower;    // from the upper to the lower third, or back
    vec3 upper_base;     // from the upper third to the base, or back
    vec3 middle_middle;  // within the middle third
    vec3 middle_lower;   // from the middle to the lower third, or back
    vec3 middle_base;    // from the middle third to the base, or back
    vec3 lower_lower;    // within the lower third
    vec3 lower_base;     // from the lower third to the base, or back
    vec3 returned;       // gain of the base by light that comes back to it
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

struct Fluence {
    vec3 upper;   // in the upper third
    vec3 middle;  // in the middle third
    vec3 lower;   // in the lower third
    vec3 base;    // flux on the base
};

const Coat lf_glaze = Coat(
    0.04,                  // alpha: width of the facet slopes; the square of an artist's roughness
    1.52,                  // eta: index of refraction, against air
    vec3(0.5, 0.2, 0.32),  // tau: optical depth, one way at normal incidence
    0.35,                  // tau_s: optical depth of scattering, beside that of absorption
    0.6                    // g: mean cosine of scattering: forwards above 0, backwards below; absent, the same in all directions
);

const Interface lf_glaze_interface = Interface(
    1.52,           // n: index of the medium below, against air
    0.04,           // alpha: width of the facets, mean of the axes
    0.008038055,    // tilt: turn of the mean facet towards a grazing direction
    0.006316437,    // gain: part of the reflected light that a second facet lets in
    0.00042082055,  // lengthening: path added by the spread of refracted directions, in thicknesses
    0.12518741      // drift: scale of the path added at grazing angles
);

const Lambert lf_stoneware = Lambert(
    vec3(0.62, 0.6, 0.55)   // albedo: part of the light that is sent back
);

const Haze lf_glaze_haze = Haze(
    vec3(0.64, 0.34, 0.45999995),                     // reduced: optical depth, with light scattered forwards taken as not scattered
    vec3(0.72400004, 0.42400002, 0.54399997),         // between: the same, with light scattered forwards twice
    vec3(0.0012118295, 0.0019125632, 0.0015111133),   // upper_upper: light that goes on to and fro and stays within the upper third
    vec3(0.00070984557, 0.0013632263, 0.0009805667),  // upper_middle: that goes from the upper to the middle third, or back
    vec3(0.00050186453, 0.0011000294, 0.000739269),   // upper_lower: from the upper to the lower third, or back
    vec3(0.0081959255, 0.01615906, 0.010613084),      // upper_base: from the upper third to the base, or back
    vec3(0.0010183486, 0.0016630971, 0.0012834289),   // middle_middle: within the middle third
    vec3(0.00067511346, 0.0012710866, 0.0009100417),  // middle_lower: from the middle to the lower third, or back
    vec3(0.00987407, 0.017341847, 0.011897616),       // middle_base: from the middle third to the base, or back
    vec3(0.0010757897, 0.0016500413, 0.001295121),    // lower_lower: within the lower third
    vec3(0.013636089, 0.019728884, 0.01461456),       // lower_base: from the lower third to the base, or back
    vec3(1.0780619, 1.2055838, 1.1193446)             // returned: gain of the base by light that comes back to it
);

// exp(x) - 1 without the cancellation near 0.
float lf_expm1(float x) {
    float near = x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0))))));
    float far = exp(x) - 1.0;
    return abs(x) > 0.4 ? far : near;
}

vec3 lf_expm1(vec3 x) {
    return vec3(lf_expm1(x.x), lf_expm1(x.y), lf_expm1(x.z));
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

// Phase function [1/sr] of mean cosine g (Henyey and Greenstein 1941, eq. 2); `deflection` is 1 - cos of the turn, 0 to 2.
float lf_henyey_greenstein(float deflection, float g) {
    float spread = (1.0 - g) * (1.0 - g) + 2.0 * g * deflection;
    return (1.0 - g) * (1.0 + g) / (12.566371 * (spread * sqrt(spread)));
}

// The phase function [1/sr] as seen by way of rough boundaries, which widen it: by `spread`, to the power in which widths add.
float lf_widened_phase(float deflection, float g, float spread) {
    float own = (1.0 - g) / (2.0 * sqrt(g));
    float width = pow(pow(own, 1.34) + spread, 0.74626863);
    float ratio = (own + sqrt(1.0 + own * own)) / (width + sqrt(1.0 + width * width));
    return lf_henyey_greenstein(deflection, g * ratio * ratio);
}

// (1 - exp(-x)) / x for x >= 0: mean of exp(-x t) over t in [0, 1].
vec3 lf_mean_transmittance(vec3 x) {
    return -lf_expm1(-x) / x;
}

// The same by the depth of scattering within `tau`, and paths in thicknesses: 1 / cos, or longer below a rough boundary.
vec3 lf_once_back(float phase, float tau_s, vec3 tau, float path_i, float path_o) {
    return tau_s * (phase * path_i * path_o) * lf_mean_transmittance(tau * (path_i + path_o));
}

// A beam on its way down a medium of depth tau: mean fluence in its thirds, and what comes to the base.
Fluence lf_fluence(vec3 tau, float path) {
    vec3 third = tau * path / 3.0;
    vec3 T = exp(-third);
    vec3 first = path * lf_mean_transmittance(third);
    vec3 second = first * T;
    return Fluence(first, second, second * T, T * T * T);
}

// Light [1/sr] that went from one part of the medium to another before it left.
vec3 lf_exchanged(Haze haze, Fluence i, Fluence o) {
    vec3 f = i.upper * (haze.upper_upper * o.upper + haze.upper_middle * o.middle + haze.upper_lower * o.lower);
    f = f + i.middle * (haze.upper_middle * o.upper + haze.middle_middle * o.middle + haze.middle_lower * o.lower);
    f = f + i.lower * (haze.upper_lower * o.upper + haze.middle_lower * o.middle + haze.lower_lower * o.lower);
    vec3 from_o = haze.upper_base * o.upper + haze.middle_base * o.middle + haze.lower_base * o.lower;
    vec3 from_i = haze.upper_base * i.upper + haze.middle_base * i.middle + haze.lower_base * i.lower;
    f = f + i.base * from_o + from_i * o.base;
    return f / 3.1415927;
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_glaze.eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float f = F * lf_ggx_lobe(wi, wo, direction, lf_glaze.alpha);
    Crossing i = lf_cross(lf_glaze_interface, lf_glaze, wi, wi);
    Crossing o = lf_cross(lf_glaze_interface, lf_glaze, wo, wo);
    float throughput = i.T * o.T / (lf_glaze.eta * lf_glaze.eta);
    float both = pow(i.spread, 1.34) + pow(o.spread, 1.34);
    float spread = both * pow(lf_glaze.alpha, 1.34);
    float path = 1.0 / i.w_cosine;
    path = path + i.lengthening;
    float path2 = 1.0 / o.w_cosine;
    path2 = path2 + o.lengthening;
    float back = 1.0 + (dot(i.w_along, o.w_along) + i.w_cosine * o.w_cosine);
    float phase = lf_widened_phase(back, lf_glaze.g, spread);
    float even = 0.07957747 * (1.0 - lf_glaze.g);
    vec3 f2 = lf_once_back(even, lf_glaze.tau_s, lf_glaze_haze.reduced, path, path2);
    f2 = f2 + lf_once_back(phase - even, lf_glaze.tau_s, lf_glaze_haze.between, path, path2);
    Fluence beam_i = lf_fluence(lf_glaze_haze.reduced, path);
    Fluence beam_o = lf_fluence(lf_glaze_haze.reduced, path2);
    f2 = f2 + beam_i.base * beam_o.base * lf_glaze_haze.returned * (lf_stoneware.albedo / 3.1415927);
    f2 = f + throughput * (f2 + lf_exchanged(lf_glaze_haze, beam_i, beam_o));
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
