#version 330 core
// oil_on_wet_asphalt: Coat over OrenNayar.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: water: absorption, water: anisotropy.
// water: under a film of 320 nm, whose colour in daylight is in its constants.
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

struct OrenNayar {
    float albedo;  // part of the light that is sent back
    float sigma;   // standard deviation of the facet angle [rad]
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

const Coat lf_water = Coat(
    vec3(-0.05917175, -0.0080569815, 0.006019214),        // film_0: f0 of the film, which depends on the angle, by Chebyshev polynomials of sqrt(c): degree 0
    vec3(0.17040384, 0.104768425, 0.05679749),            // film_1: degree 1
    vec3(-0.046546992, -0.05589053, -0.054670587),        // film_2: degree 2
    vec3(-0.010014229, -0.010763836, 3.3600256e-05),      // film_3: degree 3
    vec3(0.011933453, 0.010097774, 0.01442542),           // film_4: degree 4
    vec3(-0.0005633179, -0.00043339375, 0.00071098283),   // film_5: degree 5
    vec3(-0.0012860834, -0.0007768688, -0.00046710297),   // film_6: degree 6
    vec3(-0.00030816533, -6.42864e-05, -0.00012616254),   // film_7: degree 7
    vec3(-0.00010846462, -6.938353e-06, -0.00011930987),  // film_8: degree 8
    vec3(5.059829e-05, 6.419467e-05, -2.779998e-07),      // film_9: degree 9
    0.08,                                                 // alpha: width of the facet slopes; the square of an artist's roughness
    1.33                                                  // eta: index of refraction, against air
);

const Interface lf_water_interface = Interface(
    1.33,         // n: index of the medium below, against air
    0.08,         // alpha: width of the facets, mean of the axes
    0.019120084,  // tilt: turn of the mean facet towards a grazing direction
    0.02422721,   // gain: part of the reflected light that a second facet lets in
    0.001215193,  // lengthening: path added by the spread of refracted directions, in thicknesses
    0.3968955     // drift: scale of the path added at grazing angles
);

const OrenNayar lf_asphalt = OrenNayar(
    0.04,  // albedo: part of the light that is sent back
    0.5    // sigma: standard deviation of the facet angle [rad]
);

const vec3 lf_asphalt_returned = vec3(1.0196228, 1.019884, 1.0194327);

// Angle of the point (x, y) by a polynomial (relative error 2e-8): some drivers' atan is off by 2e-4.
float lf_atan2(float y, float x) {
    float ax = abs(x);
    float ay = abs(y);
    float t = min(ax, ay) / max(max(ax, ay), 1e-30);
    float u = t * t;
    float p = 0.10622653 + u * (-0.07465779 + u * (0.042241037 + u * (-0.015793836 + u * 0.0027817077)));
    float a = t * (1.0 + u * (-0.33333045 + u * (0.19992018 + u * (-0.1419892 + u * p))));
    a = ay > ax ? 1.5707964 - a : a;
    a = x < 0.0 ? 3.1415927 - a : a;
    return y < 0.0 ? -a : a;
}

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

// Oren and Nayar 1994, eqs. 25 to 29: diffuse grooves with one interreflection.
float lf_oren_nayar_full(FreeDirection wi, FreeDirection wo, float albedo, float sigma) {
    float sigma2 = sigma * sigma;
    float c1 = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33);
    float c2 = 0.45 * sigma2 / (sigma2 + 0.09);
    float c3 = 0.125 * sigma2 / (sigma2 + 0.09);
    float c4 = 0.17 * sigma2 / (sigma2 + 0.13);
    float sin_i = sqrt(dot(wi.along, wi.along));
    float sin_o = sqrt(dot(wo.along, wo.along));
    float elevation_i = lf_atan2(wi.cosine, sin_i) * 0.63661975;
    float elevation_o = lf_atan2(wo.cosine, sin_o) * 0.63661975;
    float higher = max(elevation_i, elevation_o);
    float lower_cos = min(wi.cosine, wo.cosine);
    float larger_cos = max(wi.cosine, wo.cosine);
    float larger_sin = max(sin_i, sin_o);
    float dot_xy = dot(wi.along, wo.along);
    float cos_phi = dot_xy / max(sin_i * sin_o, 1e-14);
    vec3 azimuth_i = wi.along / max(sin_i, 1e-14);
    vec3 azimuth_o = wo.along / max(sin_o, 1e-14);
    bool facing = dot_xy < 0.0;
    vec3 apart = azimuth_i + (facing ? azimuth_o : (-azimuth_o));
    float aside = 0.5 * dot(apart, apart);
    float forward = dot_xy / larger_cos;
    float gap = higher * (3.0 - higher * (3.0 - higher)) - lower_cos * lower_cos / (1.0 + larger_sin);
    float backward = dot_xy * gap / max(larger_cos * larger_sin, 1e-14);
    float tan_mean = (sin_i + sin_o) / (wi.cosine + wo.cosine);
    float smaller = 1.0 - higher;
    float product = smaller * (1.0 - min(elevation_i, elevation_o));
    float direct = c1 + c2 * (dot_xy >= 0.0 ? forward : backward);
    direct = direct + aside * c3 * (product * product) * tan_mean;
    float interreflected = c4 * (1.0 - cos_phi * (smaller * smaller));
    return albedo / 3.1415927 * max(direct + albedo * interreflected, 0.0);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float c = lf_rarer_cosine(lf_half_cosine(wi, wo), lf_water.eta);
    vec3 reflected = lf_fresnel_schlick(c, lf_film_on_coat(lf_water, c));
    vec3 below = 1.0 - min(max(reflected * 200.0, 0.0), 1.0);
    vec3 F = min(max(reflected, 0.0), 1.0) + 0.0025 * (below * below);
    FreeDirection direction = lf_half_vector(wi, wo);
    vec3 f = F * lf_ggx_lobe(wi, wo, direction, lf_water.alpha);
    Crossing i = lf_cross(lf_water_interface, lf_water, wi, wi);
    Crossing o = lf_cross(lf_water_interface, lf_water, wo, wo);
    vec3 throughput = i.T * o.T / (lf_water.eta * lf_water.eta);
    reflected = lf_oren_nayar_full(FreeDirection(i.w_along, i.w_cosine), FreeDirection(o.w_along, o.w_cosine), lf_asphalt.albedo, lf_asphalt.sigma) * lf_asphalt_returned;
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
