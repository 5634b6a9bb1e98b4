#version 330 core
// weathered_copper_dome: Patina over Conductor.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: patina: anisotropy, base: anisotropy.
// Indices of refraction are relative to the layer above: its own index divides those in the preset.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l, vec2 uv, float sky) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    float eta;    // index of refraction, against air
    vec3 tau;     // optical depth, one way at normal incidence
    vec3 tau_s;   // optical depth of scattering, beside that of absorption
};

struct Interface {
    float n;            // index of the medium below, against air
    float alpha;        // width of the facets, mean of the axes
    float tilt;         // turn of the mean facet towards a grazing direction
    float gain;         // part of the reflected light that a second facet lets in
    float lengthening;  // path added by the spread of refracted directions, in thicknesses
    float drift;        // scale of the path added at grazing angles
};

struct Conductor {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
};

struct Growth {
    float theta;      // value of the field up to which the surface is covered
    float age;        // age, in onset times
    float steepness;  // exponent of the age
    float softness;   // width of the edge, in the unit of the field
    float cells;      // cells of the coarsest noise in a unit of texture
    float seed;       // which noise: a whole number
    float exposure;   // part of the growth that needs the open sky
};

struct Crust {
    float blur;       // time in which growth sets in, in onset times
    vec3 absorbed;    // absorption of the crust, K times its thickness
    float scattered;  // scattering of the crust, S times its thickness
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

struct Cover {
    float covered;  // part that is covered
    float bare;     // part that is not: 1 - covered, without the cancellation
};

struct Fluence {
    vec3 upper;   // in the upper third
    vec3 middle;  // in the middle third
    vec3 lower;   // in the lower third
    vec3 base;    // flux on the base
};

struct Crossing {
    vec3 w_along;       // direction in the medium below: part along the surface, in any space
    float w_cosine;     // direction in the medium below: cosine to its normal
    float T;            // energy that passes
    float spread;       // width of the refracted directions over that of the facets
    float lengthening;  // path beyond that of the refracted direction, in thicknesses
    float drift;        // the part of it due to grazing incidence
};

struct Haze {
    vec3 reduced;        // optical depth, with light scattered forwards taken as not scattered
    vec3 upper_upper;    // light that goes on to and fro and stays within the upper third
    vec3 upper_middle;   // that goes from the upper to the middle third, or back
    vec3 upper_lower;    // from the upper to the lower third, or back
    vec3 middle_middle;  // within the middle third
    vec3 middle_lower;   // from the middle to the lower third, or back
    vec3 lower_lower;    // within the lower third
};

struct TwoFlux {
    vec3 R;  // part that it sends back
    vec3 T;  // part that it lets through
};

const Coat lf_patina_coat = Coat(
    0.5,                               // alpha: width of the facet slopes; the square of an artist's roughness
    2.7,                               // eta: index of refraction, against air
    vec3(0.8385, 3.6629999, 12.3105),  // tau: optical depth, one way at normal incidence
    vec3(0.060000002, 0.18, 0.15)      // tau_s: optical depth of scattering, beside that of absorption
);

const Interface lf_patina_interface = Interface(
    2.7,         // n: index of the medium below, against air
    0.5,         // alpha: width of the facets, mean of the axes
    0.11317518,  // tilt: turn of the mean facet towards a grazing direction
    0.30666155,  // gain: part of the reflected light that a second facet lets in
    0.09754825,  // lengthening: path added by the spread of refracted directions, in thicknesses
    11.62644     // drift: scale of the path added at grazing angles
);

const Conductor lf_base = Conductor(
    0.25,                                      // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(0.074074075, 0.3422222, 0.40814814),  // eta: index of refraction, real part
    vec3(1.4488889, 0.90666664, 0.7914815)     // k: index of refraction, imaginary part
);

const Conductor lf_base_bare = Conductor(
    0.25,                       // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(0.2, 0.924, 1.102),    // eta: index of refraction, real part
    vec3(3.912, 2.448, 2.137)   // k: index of refraction, imaginary part
);

const Growth lf_patina_growth = Growth(
    0.8415445,  // theta: value of the field up to which the surface is covered
    1.6,        // age: age, in onset times
    1.3,        // steepness: exponent of the age
    0.03,       // softness: width of the edge, in the unit of the field
    8.0,        // cells: cells of the coarsest noise in a unit of texture
    0.0,        // seed: which noise: a whole number
    0.85        // exposure: part of the growth that needs the open sky
);

const Crust lf_patina_crust = Crust(
    0.05,                   // blur: time in which growth sets in, in onset times
    vec3(2.2, 0.28, 0.45),  // absorbed: absorption of the crust, K times its thickness
    0.7                     // scattered: scattering of the crust, S times its thickness
);

const float lf_row1[6] = float[6](0.03376524, 0.16939531, 0.3806904, 0.6193096, 0.8306047, 0.96623474);

const float lf_row2[6] = float[6](0.085662246, 0.18038079, 0.23395696, 0.23395696, 0.18038079, 0.085662246);

// exp(x) - 1 without the cancellation near 0.
float lf_expm1(float x) {
    float near = x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0))))));
    float far = exp(x) - 1.0;
    return abs(x) > 0.4 ? far : near;
}

vec3 lf_expm1(vec3 x) {
    return vec3(lf_expm1(x.x), lf_expm1(x.y), lf_expm1(x.z));
}

// log(1 + x) without the cancellation near 0.
float lf_log1p(float x) {
    float s = x / (2.0 + x);
    float u = s * s;
    float near = 2.0 * s * (1.0 + u * (1.0 / 3.0 + u * (1.0 / 5.0 + u * (1.0 / 7.0 + u * (1.0 / 9.0 + u / 11.0)))));
    float far = log(1.0 + x);
    return abs(x) > 0.3 ? far : near;
}

vec3 lf_log1p(vec3 x) {
    return vec3(lf_log1p(x.x), lf_log1p(x.y), lf_log1p(x.z));
}

// Part of the age that a place feels which sees so much of the sky: from 1 in the open to 1 - exposure.
float lf_exposed_part(float sky, float exposure) {
    return 1.0 - exposure * (1.0 - sky);
}

// Threshold theta in [0, 1) at the time t: growth from random nuclei (Avrami 1939), 1 - 1/e at the onset t0.
float lf_coverage(float t, float t0, float p) {
    float logarithm = p * log(max(t / t0, 1e-30));
    return -lf_expm1(-exp(min(logarithm, 7.0)));
}

// Growth where so much of the sky is seen: its age is what is felt there.
Growth lf_aged_under(Growth growth, float sky) {
    float age = growth.age * lf_exposed_part(sky, growth.exposure);
    float theta = lf_coverage(age, 1.0, growth.steepness);
    return Growth(theta, age, growth.steepness, growth.softness, growth.cells, growth.seed, growth.exposure);
}

// Three hashed words of three words (Jarzynski and Olano 2020, listing 5).
uvec3 lf_pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    uint x = v.x + v.y * v.z;
    uint y = v.y + v.z * x;
    uint z = v.z + x * y;
    x = x ^ (x >> 16u);
    y = y ^ (y >> 16u);
    z = z ^ (z >> 16u);
    x = x + y * z;
    y = y + z * x;
    z = z + x * y;
    return uvec3(x, y, z);
}

// Three hashed words of the cell of a grid, whose corner is at whole numbers below 2^23, negative ones included.
uvec3 lf_hash_cell(vec2 cell, uint seed) {
    uvec2 i = uvec2(ivec2(cell));
    return lf_pcg3d(uvec3(i.x, i.y, seed));
}

// The random number in (0, 1) of one corner of the grid.
float lf_corner_value(vec2 corner, uint seed) {
    float u = (float(lf_hash_cell(corner, seed).x >> 8u) + 0.5) * 5.9604645e-08;
    return min(u, 0.99999994);
}

// Value noise in (0, 1) with cells of size 1 and a quintic fade, which has two continuous derivatives (Perlin 2002).
float lf_value_noise(vec2 p, uint seed) {
    vec2 cell = floor(p);
    vec2 f = p - cell;
    vec2 fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    float a = lf_corner_value(cell, seed);
    float b = lf_corner_value(cell + vec2(1.0, 0.0), seed);
    float c = lf_corner_value(cell + vec2(0.0, 1.0), seed);
    float d = lf_corner_value(cell + vec2(1.0, 0.0) + vec2(0.0, 1.0), seed);
    float lower = a + (b - a) * fade.x;
    float upper = c + (d - c) * fade.x;
    return lower + (upper - lower) * fade.y;
}

// Fractal sum of value noise in (0, 1): gain 1/2, lacunarity 2 (Musgrave, Kolb and Mace 1989).
float lf_fbm(vec2 p, uint seed) {
    float total = lf_value_noise(p, seed);
    total = total + lf_value_noise(p * 2.0, seed + 1u) / 2.0;
    total = total + lf_value_noise(p * 4.0, seed + 2u) / 4.0;
    total = total + lf_value_noise(p * 8.0, seed + 3u) / 8.0;
    return total / 1.875;
}

// The field of a layer that grows, at a place of the surface: early where it is small.
float lf_field_at(vec2 uv, Growth growth) {
    return lf_fbm(uv * growth.cells, uint(growth.seed));
}

// Part of a place that is covered, with a soft edge; `grown` in the limit of softness 0 (range 1e-3 and more).
float lf_partly_grown(float theta, float g, float softness) {
    return 1.0 / (1.0 + exp(min((g - theta) / softness, 80.0)));
}

// How much of a place is covered, where the field is g.
Cover lf_cover_at(float g, Growth growth) {
    return Cover(lf_partly_grown(growth.theta, g, growth.softness), lf_partly_grown(g, growth.theta, growth.softness));
}

// When a place is reached: the inverse of `coverage`.
float lf_onset(float g, float t0, float p) {
    float begun = -lf_log1p(-min(max(g, 5.9604645e-08), 0.99999994));
    return t0 * exp(log(begun) / p);
}

// Thickness of a layer that slows its own growth (parabolic law, Tammann 1920; Wagner 1933): rate sqrt(t - t_on) after the onset.
float lf_tarnish_thickness(float t, float t_on, float rate, float blur) {
    t = (t - t_on) / blur;
    return rate * sqrt(max(blur * (max(t, 0.0) + lf_log1p(exp(-abs(t)))), 0.0));
}

// Thickness where the field is g, over that of one onset time after the growth of a place began.
float lf_thickness_at(float g, Growth growth, float blur) {
    float t_on = lf_onset(g, 1.0, growth.steepness);
    return lf_tarnish_thickness(growth.age, t_on, 1.0, blur);
}

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(vec3 w, float tilt) {
    return sqrt(max(tilt + (1.0 - tilt) * (w.z * w.z), 0.0));
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric(float c, float eta) {
    float g = sqrt(max((eta - 1.0) * (eta + 1.0) + c * c, 0.0));
    float eta2 = eta * eta;
    float perpendicular = 1.0 / max(c + g, 1e-14);
    float parallel = 1.0 / max(eta2 * c + g, 1e-14);
    float passed = 2.0 * c * g * (perpendicular * perpendicular + eta2 * (parallel * parallel));
    return eta == 1.0 ? 1.0 : passed;
}

// Energy that passes a rough interface, from what passes the mean facet; `gain` is `second_facet`.
float lf_with_second_facet(float T, float gain) {
    return T + (1.0 - T) * gain;
}

// (1 - exp(-x)) / x for x >= 0: mean of exp(-x t) over t in [0, 1].
vec3 lf_mean_transmittance(vec3 x) {
    bvec3 thin = lessThan(x, vec3(0.01));
    vec3 safe = mix(x, vec3(1.0), thin);
    return mix(-lf_expm1(-safe) / safe, 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0))), thin);
}

// A beam on its way down a medium of depth tau: mean fluence in its thirds, and what comes to the base.
Fluence lf_fluence(vec3 tau, float path) {
    vec3 third = tau * path / 3.0;
    vec3 T = exp(-third);
    vec3 first = path * lf_mean_transmittance(third);
    vec3 second = first * T;
    return Fluence(first, second, second * T, T * T * T);
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor(float c, vec3 eta, vec3 k) {
    float c2 = c * c;
    float s2 = 1.0 - c2;
    vec3 p = (eta - k) * (eta + k) - 1.0 + c2;
    vec3 nk2 = 2.0 * eta * k;
    vec3 q = sqrt(max(p * p + nk2 * nk2, 1e-24));
    vec3 larger = sqrt(q + abs(p));
    bvec3 metal = lessThan(p, vec3(0.0));
    vec3 b = mix(vec3(1.0), larger, metal);
    vec3 twice_abc = 1.4142135 * mix(larger, nk2, metal) * c;
    vec3 even = b * (q * c2 + s2 * s2);
    vec3 odd = twice_abc * s2;
    vec3 across = b * (q + c2);
    return (across - twice_abc) * even / ((across + twice_abc) * (even + odd));
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
float lf_transmittance_dielectric2(float c, float eta) {
    float g = sqrt((eta - 1.0) * (eta + 1.0) + c * c);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float passed = 2.0 * c * g * (perpendicular * perpendicular + eta2 * (parallel * parallel));
    return passed;
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
    float T = lf_with_second_facet(lf_transmittance_dielectric2(c, coat.eta), interface_.gain);
    float grazing = lf_drift(w, interface_.drift, interface_.alpha);
    FreeDirection below = lf_refract_about_normal(air, interface_.n);
    return Crossing(below.along, below.cosine, T, lf_slope_spread(c, coat.eta), interface_.lengthening + grazing, grazing);
}

// Bouguer, Lambert and Beer: what remains after `path` times the optical depth at normal incidence.
vec3 lf_transmittance(vec3 tau, float path) {
    return exp(-tau * path);
}

// Turn a direction, azimuth kept, until its path 1 / w.z is longer by `lengthening`.
FreeDirection lf_steer(FreeDirection w, float lengthening) {
    float z = w.cosine / (1.0 + lengthening * w.cosine);
    float growth = lengthening * z * w.cosine * (w.cosine + z) / max(dot(w.along, w.along), 1e-14);
    float ratio = sqrt(1.0 + growth);
    return FreeDirection(w.along * ratio, z);
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor2(float c, vec3 eta, vec3 k) {
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

// Part of a lobe of width alpha that leaves the escape cone: sine in air, cosine in the medium of index n.
float lf_edge_reflection(float sine, float cosine, float n, float alpha) {
    float rise = 1.0 - sine;
    float width = 2.0 * alpha * n * cosine;
    return 0.5 - 0.5 * rise / sqrt(width * width + rise * rise);
}

// The same by the depth of scattering within `tau`, and paths in thicknesses: 1 / cos, or longer below a rough boundary.
vec3 lf_once_back(float phase, vec3 tau_s, vec3 tau, float path_i, float path_o) {
    return tau_s * (phase * path_i * path_o) * lf_mean_transmittance(tau * (path_i + path_o));
}

// The same for light that goes on to the other side.
vec3 lf_once_through(float phase, vec3 tau_s, vec3 tau, float path_i, float path_t) {
    vec3 a = tau * path_i;
    vec3 b = tau * path_t;
    return tau_s * (phase * path_i * path_t) * exp(-min(a, b)) * lf_mean_transmittance(abs(b - a));
}

// Light scattered once on its way to or from a mirror, or between the two times that it meets it, by two phase functions.
vec3 lf_once_by_mirror(float on, float back, vec3 tau_s, vec3 tau, float path_i, float path_o, vec3 up_i, vec3 up_o) {
    vec3 f = lf_once_through(on, tau_s, tau, path_i, path_o) * (up_i + up_o);
    return f + lf_once_back(back, tau_s, tau, path_i, path_o) * up_i * up_o;
}

// The same with what a base of reflectance F sends up again, and the coat's inner side of reflectance R down.
Fluence lf_mirrored(Fluence down, vec3 F, float R) {
    vec3 up = F * down.base;
    vec3 series = 1.0 / max(1.0 - R * up * down.base, 1e-06);
    vec3 upper = series * (down.upper + up * down.lower);
    vec3 middle = series * (down.middle + up * down.middle);
    vec3 lower = series * (down.lower + up * down.upper);
    return Fluence(upper, middle, lower, series * down.base);
}

// Light [1/sr] that went from one part of the medium to another before it left.
vec3 lf_exchanged(Haze haze, Fluence i, Fluence o) {
    vec3 f = i.upper * (haze.upper_upper * o.upper + haze.upper_middle * o.middle + haze.upper_lower * o.lower);
    f = f + i.middle * (haze.upper_middle * o.upper + haze.middle_middle * o.middle + haze.middle_lower * o.lower);
    f = f + i.lower * (haze.upper_lower * o.upper + haze.middle_lower * o.middle + haze.lower_lower * o.lower);
    return f / 3.1415927;
}

// A layer that absorbs (Kx >= 0) and scatters (Sx >= 0) diffuse light, over nothing (Kubelka 1948).
TwoFlux lf_kubelka_munk(vec3 Kx, float Sx) {
    vec3 z2 = Kx * (Kx + 2.0 * Sx);
    bvec3 thin = lessThan(z2, vec3(0.1));
    vec3 z = sqrt(mix(z2, vec3(1.0), thin));
    vec3 fall = mix(exp(-z), vec3(1.0), thin);
    vec3 sinh_z2 = 1.0 + z2 / 6.0 * (1.0 + z2 / 20.0 * (1.0 + z2 / 42.0 * (1.0 + z2 / 72.0 * (1.0 + z2 / 110.0))));
    vec3 cosh_z2 = 1.0 + z2 / 2.0 * (1.0 + z2 / 12.0 * (1.0 + z2 / 30.0 * (1.0 + z2 / 56.0 * (1.0 + z2 / 90.0))));
    vec3 sinh_z = mix(0.5 * (1.0 - fall * fall) / z, sinh_z2, thin);
    vec3 cosh_z = mix(0.5 * (1.0 + fall * fall), cosh_z2, thin);
    vec3 whole = (Kx + Sx) * sinh_z + cosh_z;
    return TwoFlux(Sx * sinh_z / whole, fall / whole);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo, vec2 uv, float sky) {
    Growth growth = lf_aged_under(lf_patina_growth, sky);
    float g = lf_field_at(uv, growth);
    Cover cover = lf_cover_at(g, growth);
    float thickness = lf_thickness_at(g, growth, lf_patina_crust.blur);
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    vec3 t = lf_patina_coat.tau * thickness;
    vec3 t2 = lf_patina_coat.tau_s * thickness;
    vec3 t3 = t + t2;
    vec3 t4 = t2 / 12.0;
    vec3 total = vec3(0.0);
    vec3 total2 = vec3(0.0);
    vec3 total3 = vec3(0.0);
    vec3 total4 = vec3(0.0);
    vec3 total5 = vec3(0.0);
    vec3 total6 = vec3(0.0);
    for (int k = 0; k < 6; ++k) {
        float u3 = lf_row1[k] * lf_row1[k] * lf_row1[k];
        float t5 = u3 * u3;
        float cosine = sqrt(max((lf_patina_interface.n - 1.0) * (lf_patina_interface.n + 1.0) + t5, 0.0)) / lf_patina_interface.n;
        float above = (1.0 - 1.0) * (1.0 + 1.0) + t5;
        float z = sqrt(max(above, 0.0));
        float z_below = sqrt(max((lf_patina_interface.n - 1.0) * (lf_patina_interface.n + 1.0) + t5, 0.0)) / lf_patina_interface.n;
        vec3 w = vec3(sqrt(max((1.0 - z) * (1.0 + z), 0.0)), 0.0, z);
        float value = lf_facet_cosine(w, lf_patina_interface.tilt);
        float c = lf_patina_coat.eta >= 1.0 ? value : z_below;
        value = 1.0 / lf_patina_coat.eta;
        value = lf_with_second_facet(lf_transmittance_dielectric(c, lf_patina_coat.eta >= 1.0 ? lf_patina_coat.eta : value), lf_patina_interface.gain);
        float T = above > 0.0 ? value : 0.0;
        t5 = 1.0 - T;
        float path = 1.0 / max(cosine, 1e-06);
        Fluence beam = lf_fluence(t3, path);
        vec3 third = t3 * path / 3.0;
        bvec3 thin = lessThan(third, vec3(0.1));
        vec3 safe = mix(third, vec3(1.0), thin);
        vec3 series = 0.5 - third / 6.0 * (1.0 - third / 4.0 * (1.0 - third / 5.0 * (1.0 - third / 6.0 * (1.0 - third / 7.0))));
        vec3 own = 2.0 * path * path * mix((1.0 - lf_mean_transmittance(safe)) / safe, series, thin);
        vec3 t6 = path * lf_mean_transmittance(third);
        vec3 next_one = t6 * t6;
        vec3 after_next = next_one * exp(-third);
        t6 = lf_fresnel_conductor(cosine, lf_base.eta, lf_base.k);
        series = 1.0 / max(1.0 - t5 * t6 * beam.base * beam.base, 1e-06);
        vec3 across = t5 * t6 * beam.base;
        vec3 one_sided = t5 * beam.upper * beam.upper + t6 * beam.lower * beam.lower;
        vec3 one_sided2 = t5 * beam.upper * beam.middle + t6 * beam.lower * beam.middle;
        vec3 one_sided3 = t5 * beam.upper * beam.lower + t6 * beam.lower * beam.upper;
        vec3 one_sided4 = t5 * beam.middle * beam.middle + t6 * beam.middle * beam.middle;
        vec3 one_sided5 = t5 * beam.middle * beam.lower + t6 * beam.middle * beam.upper;
        vec3 one_sided6 = t5 * beam.lower * beam.lower + t6 * beam.upper * beam.upper;
        float span = (lf_patina_interface.n - 1.0) * (lf_patina_interface.n + 1.0);
        cosine = sqrt(max((lf_patina_interface.n - lf_patina_interface.n) * (lf_patina_interface.n + lf_patina_interface.n) + span * u3 * u3, 0.0)) / lf_patina_interface.n;
        float S = 0.0 * cosine;
        t5 = 1.0 - S;
        path = 1.0 / max(cosine, 1e-06);
        Fluence beam2 = lf_fluence(t3, path);
        third = t3 * path / 3.0;
        thin = lessThan(third, vec3(0.1));
        safe = mix(third, vec3(1.0), thin);
        vec3 series2 = 0.5 - third / 6.0 * (1.0 - third / 4.0 * (1.0 - third / 5.0 * (1.0 - third / 6.0 * (1.0 - third / 7.0))));
        vec3 own2 = 2.0 * path * path * mix((1.0 - lf_mean_transmittance(safe)) / safe, series2, thin);
        t6 = path * lf_mean_transmittance(third);
        vec3 next_one2 = t6 * t6;
        vec3 after_next2 = next_one2 * exp(-third);
        t6 = lf_fresnel_conductor(cosine, lf_base.eta, lf_base.k);
        series2 = 1.0 / max(1.0 - t5 * t6 * beam2.base * beam2.base, 1e-06);
        vec3 across2 = t5 * t6 * beam2.base;
        vec3 one_sided7 = t5 * beam2.upper * beam2.upper + t6 * beam2.lower * beam2.lower;
        vec3 one_sided8 = t5 * beam2.upper * beam2.middle + t6 * beam2.lower * beam2.middle;
        vec3 one_sided9 = t5 * beam2.upper * beam2.lower + t6 * beam2.lower * beam2.upper;
        vec3 one_sided10 = t5 * beam2.middle * beam2.middle + t6 * beam2.middle * beam2.middle;
        vec3 one_sided11 = t5 * beam2.middle * beam2.lower + t6 * beam2.middle * beam2.upper;
        vec3 one_sided12 = t5 * beam2.lower * beam2.lower + t6 * beam2.upper * beam2.upper;
        total = total + lf_row2[k] * (6.0 * lf_row1[k] * lf_row1[k] * u3 * (1.0 / (lf_patina_interface.n * lf_patina_interface.n)) * (own + series * (one_sided + across * (beam.upper * beam.lower + beam.lower * beam.upper))) + 6.0 * lf_row1[k] * lf_row1[k] * u3 * (span / (lf_patina_interface.n * lf_patina_interface.n)) * (own2 + series2 * (one_sided7 + across2 * (beam2.upper * beam2.lower + beam2.lower * beam2.upper))));
        total2 = total2 + lf_row2[k] * (6.0 * lf_row1[k] * lf_row1[k] * u3 * (1.0 / (lf_patina_interface.n * lf_patina_interface.n)) * (next_one + series * (one_sided2 + across * (beam.upper * beam.middle + beam.lower * beam.middle))) + 6.0 * lf_row1[k] * lf_row1[k] * u3 * (span / (lf_patina_interface.n * lf_patina_interface.n)) * (next_one2 + series2 * (one_sided8 + across2 * (beam2.upper * beam2.middle + beam2.lower * beam2.middle))));
        total3 = total3 + lf_row2[k] * (6.0 * lf_row1[k] * lf_row1[k] * u3 * (1.0 / (lf_patina_interface.n * lf_patina_interface.n)) * (after_next + series * (one_sided3 + across * (beam.upper * beam.upper + beam.lower * beam.lower))) + 6.0 * lf_row1[k] * lf_row1[k] * u3 * (span / (lf_patina_interface.n * lf_patina_interface.n)) * (after_next2 + series2 * (one_sided9 + across2 * (beam2.upper * beam2.upper + beam2.lower * beam2.lower))));
        total4 = total4 + lf_row2[k] * (6.0 * lf_row1[k] * lf_row1[k] * u3 * (1.0 / (lf_patina_interface.n * lf_patina_interface.n)) * (own + series * (one_sided4 + across * (beam.middle * beam.middle + beam.middle * beam.middle))) + 6.0 * lf_row1[k] * lf_row1[k] * u3 * (span / (lf_patina_interface.n * lf_patina_interface.n)) * (own2 + series2 * (one_sided10 + across2 * (beam2.middle * beam2.middle + beam2.middle * beam2.middle))));
        total5 = total5 + lf_row2[k] * (6.0 * lf_row1[k] * lf_row1[k] * u3 * (1.0 / (lf_patina_interface.n * lf_patina_interface.n)) * (next_one + series * (one_sided5 + across * (beam.middle * beam.upper + beam.middle * beam.lower))) + 6.0 * lf_row1[k] * lf_row1[k] * u3 * (span / (lf_patina_interface.n * lf_patina_interface.n)) * (next_one2 + series2 * (one_sided11 + across2 * (beam2.middle * beam2.upper + beam2.middle * beam2.lower))));
        total6 = total6 + lf_row2[k] * (6.0 * lf_row1[k] * lf_row1[k] * u3 * (1.0 / (lf_patina_interface.n * lf_patina_interface.n)) * (own + series * (one_sided6 + across * (beam.lower * beam.upper + beam.upper * beam.lower))) + 6.0 * lf_row1[k] * lf_row1[k] * u3 * (span / (lf_patina_interface.n * lf_patina_interface.n)) * (own2 + series2 * (one_sided12 + across2 * (beam2.lower * beam2.upper + beam2.upper * beam2.lower))));
    }
    vec3 t5 = t4 * total;
    vec3 t6 = t4 * total2;
    vec3 t7 = t4 * total3;
    vec3 t8 = t4 * total2;
    vec3 t9 = t4 * total4;
    vec3 t10 = t4 * total5;
    vec3 t11 = t4 * total3;
    vec3 t12 = t4 * total5;
    vec3 t13 = t4 * total6;
    vec3 t14 = 0.0 - t8;
    vec3 t15 = 0.0 - t11;
    vec3 t16 = 1.0 / max(1.0 - t5, 1e-06);
    vec3 t17 = (0.0 - t6) * t16;
    vec3 t18 = (0.0 - t7) * t16;
    t5 = t5 * t16;
    t6 = t6 * t16;
    t7 = t7 * t16;
    t16 = 0.0 - t12 - t15 * t17;
    vec3 t19 = 1.0 / max(1.0 - t9 - t14 * t17, 1e-06);
    vec3 t20 = (0.0 - t10 - t14 * t18) * t19;
    t8 = (t8 - t14 * t5) * t19;
    t9 = (t9 - t14 * t6) * t19;
    t10 = (t10 - t14 * t7) * t19;
    t14 = t18 - t17 * t20;
    t18 = 1.0 / max(1.0 - t13 - t15 * t18 - t16 * t20, 1e-06);
    t12 = (t12 - t15 * t6 - t16 * t9) * t18;
    t13 = (t13 - t15 * t7 - t16 * t10) * t18;
    bool lit2 = min(wi.cosine, wo.cosine) > 1e-07;
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_patina_coat.eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float f = F * lf_ggx_lobe(wi, wo, direction, lf_patina_coat.alpha);
    Crossing i = lf_cross(lf_patina_interface, Coat(lf_patina_coat.alpha, lf_patina_coat.eta, t, t2), wi, wi);
    Crossing o = lf_cross(lf_patina_interface, Coat(lf_patina_coat.alpha, lf_patina_coat.eta, t, t2), wo, wo);
    float throughput = i.T * o.T / (lf_patina_coat.eta * lf_patina_coat.eta);
    float straight = (i.w_cosine + o.w_cosine) / (i.w_cosine * o.w_cosine);
    float added = i.lengthening + o.lengthening;
    float sin_i = sqrt(dot(wi.along, wi.along));
    float sin_o = sqrt(dot(wo.along, wo.along));
    float R_i = 1.0 - i.T;
    float R_o = 1.0 - o.T;
    vec3 directional = lf_transmittance(t + t2, straight + 0.5 * added);
    FreeDirection wi2 = lf_steer(FreeDirection(i.w_along, i.w_cosine), 0.5 * i.drift);
    FreeDirection wo2 = lf_steer(FreeDirection(o.w_along, o.w_cosine), 0.5 * o.drift);
    FreeDirection h = lf_half_vector(wi2, wo2);
    vec3 F2 = lf_fresnel_conductor2(lf_half_cosine(wi2, wo2), lf_base.eta, lf_base.k);
    float R = 0.5 * (R_i + R_o);
    float edge_i = lf_edge_reflection(sin_i, i.w_cosine, lf_patina_interface.n, lf_base.alpha);
    float edge_o = lf_edge_reflection(sin_o, o.w_cosine, lf_patina_interface.n, lf_base.alpha);
    vec3 q = F2 * directional * (R + (1.0 - R) * (0.5 * (edge_i + edge_o)));
    float spread = (pow(i.spread, 1.34) + pow(o.spread, 1.34)) * pow(lf_patina_coat.alpha, 1.34);
    float total7 = spread + 3.0 * pow(lf_base.alpha, 1.34);
    total7 = total7 + 2.0 * pow(lf_patina_coat.alpha, 1.34);
    float width = pow(total7, 0.74626863);
    float lobe = lf_ggx_lobe(wi2, wo2, h, width);
    vec3 lobes = lobe / max(1.0 - q, 1e-06);
    total7 = spread + 2.0 * pow(lf_base.alpha, 1.34);
    total7 = total7 + pow(lf_patina_coat.alpha, 1.34);
    width = pow(total7, 0.74626863);
    lobe = lf_ggx_lobe(wi2, wo2, h, width);
    lobes = lobe + q * lobes;
    total7 = spread + pow(lf_base.alpha, 1.34);
    width = pow(total7, 0.74626863);
    lobe = lf_ggx_lobe(wi2, wo2, h, width);
    lobes = lobe + q * lobes;
    vec3 f2 = f + throughput * (F2 * directional) * lobes;
    float path = 1.0 / i.w_cosine;
    path = path + i.lengthening;
    float path2 = 1.0 / o.w_cosine;
    path2 = path2 + o.lengthening;
    vec3 f3 = lf_once_back(0.07957747, t2, t3, path, path2);
    Fluence beam_i = lf_fluence(t3, path);
    Fluence beam_o = lf_fluence(t3, path2);
    vec3 up_i = lf_fresnel_conductor2(i.w_cosine, lf_base.eta, lf_base.k) * exp(-t3 * path);
    vec3 up_o = lf_fresnel_conductor2(o.w_cosine, lf_base.eta, lf_base.k) * exp(-t3 * path2);
    vec3 f4 = lf_once_by_mirror(0.07957747, 0.07957747, t2, t3, path, path2, up_i, up_o);
    f3 = f3 + f4;
    beam_i = lf_mirrored(beam_i, lf_fresnel_conductor2(i.w_cosine, lf_base.eta, lf_base.k), R_i);
    beam_o = lf_mirrored(beam_o, lf_fresnel_conductor2(o.w_cosine, lf_base.eta, lf_base.k), R_o);
    f2 = f2 + throughput * (f3 + lf_exchanged(Haze(t3, (t5 - t17 * t8 - t14 * ((t11 - t15 * t5 - t16 * t8) * t18)) * t4, (t6 - t17 * t9 - t14 * t12) * t4, (t7 - t17 * t10 - t14 * t13) * t4, (t9 - t20 * t12) * t4, (t10 - t20 * t13) * t4, t13 * t4), beam_i, beam_o));
    vec3 patina = lit2 ? f2 : vec3(0.0);
    TwoFlux layer = lf_kubelka_munk(lf_patina_crust.absorbed * thickness, lf_patina_crust.scattered * thickness);
    vec3 diffuse = layer.R / 3.1415927;
    patina = patina + diffuse;
    F2 = lf_fresnel_conductor2(lf_half_cosine(wi, wo), lf_base_bare.eta, lf_base_bare.k);
    direction = lf_half_vector(wi, wo);
    vec3 bare = F2 * lf_ggx_lobe(wi, wo, direction, lf_base_bare.alpha);
    f2 = cover.bare * bare + cover.covered * patina;
    return lit ? f2 : vec3(0.0);
}

// BRDF [1/sr] in any frame: an isotropic surface asks for no tangent.
vec3 lf_brdf(vec3 n, vec3 v, vec3 l, vec2 uv, float sky) {
    float NoL = dot(n, l);
    float NoV = dot(n, v);
    return lf_evaluate(FreeDirection(l - NoL * n, NoL), FreeDirection(v - NoV * n, NoV), uv, sky);
}

#ifndef LF_LIBRARY

#ifndef LF_LIGHTS
#define LF_LIGHTS 1
#endif

in vec3 v_position;  // this, u_eye and u_light in one space, such as the world's
in vec3 v_normal;
in vec2 v_uv;        // texture coordinates
out vec4 color;

uniform vec3 u_eye;
uniform vec3 u_up;  // where the sky is, a unit vector
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
    vec2 uv = v_uv;
    float sky = 0.5 + 0.5 * dot(n, u_up);  // part of it that is seen in the open; times ambient occlusion, where you have it
    vec3 radiance = vec3(0.0);
    for (int k = 0; k < LF_LIGHTS; ++k) {
        vec3 l;
        vec3 irradiance = lf_light(u_light[k], u_light_rgb[k], v_position, l);
        radiance += lf_brdf(n, v, l, uv, sky) * irradiance * max(dot(n, l), 0.0);
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
