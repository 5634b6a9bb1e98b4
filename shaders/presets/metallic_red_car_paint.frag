#version 330 core
// metallic_red_car_paint: Coat over Coat over Flakes.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: clear_coat: absorption, clear_coat: anisotropy, colour: anisotropy.
// Indices of refraction are relative to the layer above: its own index divides those in the preset.
//
// vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l, vec2 uv, float distance) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    float eta;    // index of refraction, against air
};

struct Coat2 {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    float eta;    // index of refraction, against air
    vec3 tau;     // optical depth, one way at normal incidence
};

struct Interface {
    float n;            // index of the medium below, against air
    float alpha;        // width of the facets, mean of the axes
    float tilt;         // turn of the mean facet towards a grazing direction
    float gain;         // part of the reflected light that a second facet lets in
    float lengthening;  // path added by the spread of refracted directions, in thicknesses
    float drift;        // scale of the path added at grazing angles
};

struct Flakes {
    float alpha;          // width of the facet slopes of one flake; the square of an artist's roughness
    float sigma;          // spread of the tilts, as a width of slopes
    vec3 eta;             // index of refraction, real part
    vec3 k;               // index of refraction, imaginary part
    float coverage;       // part of the area that is flakes; absent: all of it
    vec3 albedo;          // light that the pigment between flakes sends back
    float per_uv;         // flakes along one unit of the texture coordinates
    float half_distance;  // distance at which half of the tilt is drawn, in the scene's unit
    float seed;           // whole number; another one, other flakes
};

struct Crossing {
    vec3 w;             // direction in the medium below
    float T;            // energy that passes
    float spread;       // width of the refracted directions over that of the facets
    float lengthening;  // path beyond that of the refracted direction, in thicknesses
    float drift;        // the part of it due to grazing incidence
};

const Coat lf_clear_coat = Coat(
    0.02,  // alpha: width of the facet slopes; the square of an artist's roughness
    1.5    // eta: index of refraction, against air
);

const Coat2 lf_colour = Coat2(
    0.05,                  // alpha: width of the facet slopes; the square of an artist's roughness
    1.0,                   // eta: index of refraction, against air
    vec3(0.04, 0.9, 1.1)   // tau: optical depth, one way at normal incidence
);

const Interface lf_clear_coat_interface = Interface(
    1.5,            // n: index of the medium below, against air
    0.02,           // alpha: width of the facets, mean of the axes
    0.0031546694,   // tilt: turn of the mean facet towards a grazing direction
    0.0015962153,   // gain: part of the reflected light that a second facet lets in
    0.00010262683,  // lengthening: path added by the spread of refracted directions, in thicknesses
    0.036786783     // drift: scale of the path added at grazing angles
);

const Interface lf_colour_interface = Interface(
    1.5,          // n: index of the medium below, against air
    0.05,         // alpha: width of the facets, mean of the axes
    0.010720346,  // tilt: turn of the mean facet towards a grazing direction
    0.009790741,  // gain: part of the reflected light that a second facet lets in
    0.0,          // lengthening: path added by the spread of refracted directions, in thicknesses
    0.0           // drift: scale of the path added at grazing angles
);

const Flakes lf_flakes = Flakes(
    0.1,                                 // alpha: width of the facet slopes of one flake; the square of an artist's roughness
    0.22,                                // sigma: spread of the tilts, as a width of slopes
    vec3(1.0026666, 0.658, 0.40466666),  // eta: index of refraction, real part
    vec3(5.1053333, 4.370667, 3.57),     // k: index of refraction, imaginary part
    0.45,                                // coverage: part of the area that is flakes; absent: all of it
    vec3(0.3, 0.02, 0.015),              // albedo: light that the pigment between flakes sends back
    200.0,                               // per_uv: flakes along one unit of the texture coordinates
    6.0,                                 // half_distance: distance at which half of the tilt is drawn, in the scene's unit
    0.0                                  // seed: whole number; another one, other flakes
);

const vec3 lf_flakes_returned = vec3(1.1343322, 1.0002759, 1.0001109);

const vec3 lf_flakes_lobes = vec3(0.38999027, 0.39579824, 0.40050957);

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

// exp(x) - 1 without the cancellation near 0.
float lf_expm1(float x) {
    float near = x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0))))));
    float far = exp(x) - 1.0;
    return abs(x) > 0.4 ? far : near;
}

vec3 lf_expm1(vec3 x) {
    return vec3(lf_expm1(x.x), lf_expm1(x.y), lf_expm1(x.z));
}

// Error function: a series in x^2 below 1, exp(-x^2) times a polynomial in 1 / (1 + x / 2) above (relative error 1.3e-7).
float lf_erf(float x) {
    float a = abs(x);
    float u = x * x;
    float near = x * (1.1283791 + u * (-0.3761232 + u * (0.11280131 + u * (-0.02670995 + u * (0.004916023 - u * 0.00056253962)))));
    float t = 1.0 / (1.0 + 0.5 * a);
    float p = 0.2814202 + t * (0.28951687 + t * (0.21660148 + t * (0.2249226 + t * (0.08896493 - t * 0.10282357))));
    float far = sign(x) * (1.0 - t * p * exp(-u));
    return a < 1.0 ? near : far;
}

vec3 lf_erf(vec3 x) {
    return vec3(lf_erf(x.x), lf_erf(x.y), lf_erf(x.z));
}

// Part of the tilt of flakes that is still drawn flake by flake: 1 near by, 1/2 at `half_distance`, 0 far off.
float lf_kept_tilt(float distance, float half_distance) {
    float ratio = distance / half_distance;
    return 1.0 / (1.0 + ratio * ratio);
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

// -log u of a number in (0, 1), 24 of the bits, with all digits at both ends; in the precision of `like`.
float lf_exponential(uint bits, float like) {
    uint odd = (bits >> 7u) | 1u;
    uint near = floatBitsToUint(float(odd));
    uint halvings = (1278543090u - near) >> 23u;
    float beyond_one = float(int(odd << halvings) - 33554432);
    float s = beyond_one / (beyond_one + 6.7108864e+07);
    float s2 = s * s;
    float total = 0.14285715 * s2 + 0.2;
    total = total * s2 + 0.33333334;
    total = total * s2 + 1.0;
    return abs(float(halvings) * 0.6931472) - 2.0 * (s * total);
}

// Point of the unit circle, u turns from (1, 0), u in (0, 1) by 24 of the bits; in the precision of `like`.
vec2 lf_circle(uint bits, float like) {
    uint odd = (bits >> 7u) | 1u;
    uint quarter = (odd + 4194304u) >> 23u;
    float x = float(int(odd - (quarter << 23u))) * 1.8725352e-07;
    float x2 = x * x;
    vec2 total = vec2(0.0013888889, 0.0001984127) - x2 * vec2(2.4801588e-05, 2.7557319e-06);
    total = vec2(0.041666668, 0.008333334) - abs(x2 * total);
    total = vec2(0.5, 0.16666667) - abs(x2 * total);
    total = vec2(1.0) - abs(x2 * total);
    float sine = x * total.y;
    bool turned = (quarter & 1u) != 0u;
    bool left = ((quarter + 1u) & 2u) != 0u;
    bool below = (quarter & 2u) != 0u;
    float across = turned ? sine : total.x;
    float along = turned ? total.x : sine;
    return vec2((left ? (-1.0) : 1.0) * across, (below ? (-1.0) : 1.0) * along);
}

// Tilt of the flake at texture coordinates uv; `per_uv` flakes lie along one unit of them.
vec2 lf_flake_tilt(vec2 uv, float per_uv, float spread, uint seed) {
    uvec3 bits = lf_hash_cell(floor(uv * per_uv), seed);
    return spread * sqrt(lf_exponential(~bits.x, per_uv)) * lf_circle(bits.y, per_uv);
}

// Part of the variance of tilts that is not drawn flake by flake: 1 - kept_tilt^2, with its own digits near by.
float lf_lost_variance(float distance, float half_distance) {
    float ratio = distance / half_distance;
    float ratio2 = ratio * ratio;
    float kept = 1.0 / (1.0 + ratio2);
    return ratio2 * kept * (1.0 + kept);
}

// The cosine between either direction and their half vector.
float lf_half_cosine(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return 0.5 * sqrt(dot(s, s));
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
vec3 lf_half_vector(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    float inverse = inversesqrt(dot(s, s));
    return s * inverse;
}

// NoW (1 + 2 Lambda) of the GGX distribution (Heitz 2014, eq. 72, multiplied out).
float lf_ggx_projection(vec3 w, float alpha) {
    float a2 = alpha * alpha;
    return sqrt(a2 + (1.0 - a2) * (w.z * w.z));
}

// D V, the GGX density (Walter et al. 2007, eq. 33) and height-correlated Smith masking (Heitz 2014, eq. 99), by one division.
float lf_ggx_lobe(vec3 wi, vec3 wo, vec3 h, float alpha) {
    float a2 = alpha * alpha;
    float e = dot(h.xy, h.xy) + a2 * (h.z * h.z);
    float hidden = wo.z * lf_ggx_projection(wi, alpha) + wi.z * lf_ggx_projection(wo, alpha);
    return 0.15915494 * a2 / (e * e * hidden);
}

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(vec3 w, float tilt) {
    return sqrt(tilt + (1.0 - tilt) * (w.z * w.z));
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
float lf_drift(vec3 w, float scale, float alpha) {
    float one_minus = 1.0 - w.z;
    return scale * exp(3.16 * log(max(one_minus, 1e-30)) - 7.0 * alpha * one_minus);
}

// Direction below a boundary of relative index `eta` (Snell's law); its z is 0 under total internal reflection.
vec3 lf_refract_about_normal(vec3 w, float eta) {
    float z2 = (eta - 1.0) * (eta + 1.0) + w.z * w.z;
    float inverse = 1.0 / eta;
    return vec3(w.xy, sqrt(z2)) * inverse;
}

// Width of the refracted directions over the width of the facets, to first order in slope.
float lf_slope_spread(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g = sqrt(delta + c * c);
    return 0.5 * delta / (g * (g + c));
}

// Follow one direction through the rough top of a coat with its relative index; `air` is the direction above all of them.
Crossing lf_cross(Interface interface_, Coat coat, vec3 w, vec3 air) {
    float c = lf_facet_cosine(w, interface_.tilt);
    float T = lf_with_second_facet(lf_transmittance_dielectric(c, coat.eta), interface_.gain);
    float grazing = lf_drift(w, interface_.drift, interface_.alpha);
    vec3 below = lf_refract_about_normal(air, interface_.n);
    return Crossing(below, T, lf_slope_spread(c, coat.eta), interface_.lengthening + grazing, grazing);
}

// Turn a direction, azimuth kept, until its path 1 / w.z is longer by `lengthening`.
vec3 lf_steer(vec3 w, float lengthening) {
    float z = w.z / (1.0 + lengthening * w.z);
    float growth = lengthening * z * w.z * (w.z + z) / max(dot(w.xy, w.xy), 1e-14);
    float ratio = sqrt(1.0 + growth);
    return vec3(w.xy * ratio, z);
}

// Exact reflectance of a dielectric boundary (Born and Wolf 1999, 1.5.2); 1 under total internal reflection.
float lf_fresnel_dielectric2(float c, float eta) {
    return 0.0;
}

// Part of a lobe of width alpha that leaves the escape cone: sine in air, cosine in the medium of index n.
float lf_edge_reflection(float sine, float cosine, float n, float alpha) {
    float rise = 1.0 - sine;
    float width = 2.0 * alpha * n * cosine;
    return 0.5 - 0.5 * rise / sqrt(width * width + rise * rise);
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric2(float c, float eta) {
    return 1.0;
}

// Follow one direction through the rough top of a coat with its relative index; `air` is the direction above all of them.
Crossing lf_cross(Interface interface_, Coat2 coat, vec3 w, vec3 air) {
    float c = lf_facet_cosine(w, interface_.tilt);
    float T = lf_with_second_facet(lf_transmittance_dielectric2(c, coat.eta), interface_.gain);
    float grazing = lf_drift(w, interface_.drift, interface_.alpha);
    vec3 below = lf_refract_about_normal(air, interface_.n);
    return Crossing(below, T, lf_slope_spread(c, coat.eta), interface_.lengthening + grazing, grazing);
}

// Bouguer, Lambert and Beer: what remains after `path` times the optical depth at normal incidence.
vec3 lf_transmittance(vec3 tau, float path) {
    return exp(-tau * path);
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

// Density of a tilted flake's facet normals, their squared width alpha2: Beckmann's, moved among slopes (Olano and Baker 2010, eq. 7).
float lf_tilted_d(vec3 h, vec2 tilt, float alpha2) {
    float x = h.x - h.z * tilt.x;
    float y = h.y - h.z * tilt.y;
    float inverse = 1.0 / (h.z * h.z);
    return exp(-((x * x + y * y) / alpha2) * inverse) * (inverse * inverse) / (3.1415927 * alpha2);
}

// NoW (1 + 2 Lambda) of the Beckmann distribution (Heitz 2014, eq. 66, multiplied out).
float lf_beckmann_projection(vec3 w, float alpha) {
    float slope = max(sqrt(alpha * alpha * dot(w.xy, w.xy)), 1e-10);
    float q = w.z / slope;
    return w.z * lf_erf(q) + slope * exp(-q * q) * 0.5641896;
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / max(NoV * projection_l + NoL * projection_v, 1e-14);
}

// BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine.
vec3 lf_evaluate(vec3 wi, vec3 wo, vec2 uv, float distance) {
    float kept = lf_kept_tilt(distance, lf_flakes.half_distance);
    vec2 tilt = lf_flake_tilt(uv, lf_flakes.per_uv, lf_flakes.sigma * kept, uint(lf_flakes.seed));
    float lost = lf_lost_variance(distance, lf_flakes.half_distance);
    bool lit = min(wi.z, wo.z) > 1e-07;
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_clear_coat.eta);
    float f = F * lf_ggx_lobe(wi, wo, lf_half_vector(wi, wo), lf_clear_coat.alpha);
    Crossing i = lf_cross(lf_clear_coat_interface, lf_clear_coat, wi, wi);
    Crossing o = lf_cross(lf_clear_coat_interface, lf_clear_coat, wo, wo);
    float throughput = i.T * o.T / (lf_clear_coat.eta * lf_clear_coat.eta);
    float sin_i = sqrt(dot(wi.xy, wi.xy));
    float sin_o = sqrt(dot(wo.xy, wo.xy));
    float R_i = 1.0 - i.T;
    float R_o = 1.0 - o.T;
    vec3 wi2 = lf_steer(i.w, 0.5 * i.drift);
    vec3 wo2 = lf_steer(o.w, 0.5 * o.drift);
    vec3 h = lf_half_vector(wi2, wo2);
    F = lf_fresnel_dielectric2(lf_half_cosine(wi2, wo2), lf_colour.eta);
    float R = 0.5 * (R_i + R_o);
    float edge_i = lf_edge_reflection(sin_i, i.w.z, lf_clear_coat_interface.n, lf_colour.alpha);
    float edge_o = lf_edge_reflection(sin_o, o.w.z, lf_clear_coat_interface.n, lf_colour.alpha);
    float q = F * (R + (1.0 - R) * (0.5 * (edge_i + edge_o)));
    float spread = (pow(i.spread, 1.34) + pow(o.spread, 1.34)) * pow(lf_clear_coat.alpha, 1.34);
    float total = spread + 3.0 * pow(lf_colour.alpha, 1.34);
    total = total + 2.0 * pow(lf_clear_coat.alpha, 1.34);
    float width = pow(total, 0.74626863);
    float lobe = lf_ggx_lobe(wi2, wo2, h, width);
    float lobes = lobe / (1.0 - q);
    total = spread + 2.0 * pow(lf_colour.alpha, 1.34);
    total = total + pow(lf_clear_coat.alpha, 1.34);
    width = pow(total, 0.74626863);
    lobe = lf_ggx_lobe(wi2, wo2, h, width);
    lobes = lobe + q * lobes;
    total = spread + pow(lf_colour.alpha, 1.34);
    width = pow(total, 0.74626863);
    lobe = lf_ggx_lobe(wi2, wo2, h, width);
    lobes = lobe + q * lobes;
    f = f + throughput * F * lobes;
    Crossing i2 = lf_cross(lf_colour_interface, lf_colour, i.w, wi);
    Crossing o2 = lf_cross(lf_colour_interface, lf_colour, o.w, wo);
    float throughput2 = i2.T * o2.T / (lf_colour.eta * lf_colour.eta);
    float straight = (i2.w.z + o2.w.z) / (i2.w.z * o2.w.z);
    float added = i2.lengthening + o2.lengthening;
    throughput = throughput2 * throughput;
    F = 1.0 - i2.T;
    R_i = F + i2.T * i2.T * R_i / (1.0 - F * R_i);
    F = 1.0 - o2.T;
    R_o = F + o2.T * o2.T * R_o / (1.0 - F * R_o);
    vec3 directional = lf_transmittance(lf_colour.tau, straight + 0.5 * added);
    vec3 diffuse = lf_transmittance(lf_colour.tau, straight + added);
    wi = lf_steer(i2.w, 0.5 * i2.drift);
    wo = lf_steer(o2.w, 0.5 * o2.drift);
    h = lf_half_vector(wi, wo);
    vec3 F2 = lf_fresnel_conductor(lf_half_cosine(wi, wo), lf_flakes.eta, lf_flakes.k);
    F2 = lf_flakes.coverage * F2;
    R = 0.5 * (R_i + R_o);
    float t = sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma);
    edge_i = lf_edge_reflection(sin_i, i2.w.z, lf_colour_interface.n, t);
    edge_o = lf_edge_reflection(sin_o, o2.w.z, lf_colour_interface.n, t);
    vec3 q2 = F2 * directional * (R + (1.0 - R) * (0.5 * (edge_i + edge_o)));
    spread = (pow(i.spread, 1.5) + pow(o.spread, 1.5)) * pow(lf_clear_coat.alpha, 1.5);
    spread = spread + (pow(1e-30, 1.5) + pow(1e-30, 1.5)) * pow(lf_colour.alpha, 1.5);
    total = spread + 2.2795072 * pow(sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma), 1.5);
    total = total + 2.0 * pow(lf_colour.alpha, 1.5);
    width = pow(total, 0.6666667);
    t = sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma);
    float own2 = t * t;
    total = spread + 1.279507 * pow(sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma), 1.5);
    total = total + 2.0 * pow(lf_colour.alpha, 1.5);
    added = own2 * lf_expm1(1.3333334 * lf_log1p(total / pow(t, 1.5)));
    float alpha2 = lf_flakes.alpha * lf_flakes.alpha + lost * (lf_flakes.sigma * lf_flakes.sigma) + min(added, 2.25 - own2);
    float projection_i = lf_beckmann_projection(wi, width);
    float projection_o = lf_beckmann_projection(wo, width);
    lobe = lf_tilted_d(h, tilt, alpha2) * lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    vec3 lobes2 = lobe / max(1.0 - q2, 1e-06);
    total = spread + 1.6817929 * pow(sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma), 1.5);
    total = total + pow(lf_colour.alpha, 1.5);
    width = pow(total, 0.6666667);
    t = sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma);
    own2 = t * t;
    total = spread + 0.68179286 * pow(sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma), 1.5);
    total = total + pow(lf_colour.alpha, 1.5);
    added = own2 * lf_expm1(1.3333334 * lf_log1p(total / pow(t, 1.5)));
    alpha2 = lf_flakes.alpha * lf_flakes.alpha + lost * (lf_flakes.sigma * lf_flakes.sigma) + min(added, 2.25 - own2);
    projection_i = lf_beckmann_projection(wi, width);
    projection_o = lf_beckmann_projection(wo, width);
    lobe = lf_tilted_d(h, tilt, alpha2) * lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    lobes2 = lobe + q2 * lobes2;
    total = spread + pow(sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma), 1.5);
    width = pow(total, 0.6666667);
    t = sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma);
    own2 = t * t;
    total = spread + 0.0 * pow(sqrt(lf_flakes.alpha * lf_flakes.alpha + lf_flakes.sigma * lf_flakes.sigma), 1.5);
    added = own2 * lf_expm1(1.3333334 * lf_log1p(total / pow(t, 1.5)));
    alpha2 = lf_flakes.alpha * lf_flakes.alpha + lost * (lf_flakes.sigma * lf_flakes.sigma) + min(added, 2.25 - own2);
    projection_i = lf_beckmann_projection(wi, width);
    projection_o = lf_beckmann_projection(wo, width);
    lobe = lf_tilted_d(h, tilt, alpha2) * lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    lobes2 = lobe + q2 * lobes2;
    vec3 f2 = f + throughput * (F2 * directional) * lobes2;
    vec3 albedo = (1.0 - lf_flakes.coverage) * lf_flakes.albedo;
    vec3 reflected = albedo / 3.1415927 * lf_flakes_returned;
    reflected = reflected * (1.0 / (1.0 - lf_flakes_lobes * R_i * lf_transmittance(lf_colour.tau, 2.0 / i2.w.z)));
    reflected = reflected * (1.0 / (1.0 - lf_flakes_lobes * R_o * lf_transmittance(lf_colour.tau, 2.0 / o2.w.z)));
    f2 = f2 + throughput * diffuse * reflected;
    return lit ? f2 : vec3(0.0);
}

// BRDF [1/sr] in any frame; t is a tangent, along which alpha_x is measured.
vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l, vec2 uv, float distance) {
    vec3 x = normalize(t - dot(t, n) * n);
    mat3 surface = transpose(mat3(x, cross(n, x), n));
    return lf_evaluate(surface * l, surface * v, uv, distance);
}

#ifndef LF_LIBRARY

#ifndef LF_LIGHTS
#define LF_LIGHTS 1
#endif

in vec3 v_position;  // this, u_eye and u_light in one space, such as the world's
in vec3 v_normal;
in vec3 v_tangent;   // along which widths and patterns are measured
in vec2 v_uv;        // texture coordinates
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
    vec2 uv = v_uv;
    float distance = length(u_eye - v_position);  // in the unit of the space above
    vec3 radiance = vec3(0.0);
    for (int k = 0; k < LF_LIGHTS; ++k) {
        vec3 l;
        vec3 irradiance = lf_light(u_light[k], u_light_rgb[k], v_position, l);
        radiance += lf_brdf(n, v_tangent, v, l, uv, distance) * irradiance * max(dot(n, l), 0.0);
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
