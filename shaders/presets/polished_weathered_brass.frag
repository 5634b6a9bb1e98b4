#version 330 core
// polished_weathered_brass: Polish over Overgrowth over Deposit over Conductor.
// Printed by layerfit 0.1.0.
// Left out, because this material does without: brass: anisotropy.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l, vec2 uv) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Polish {
    float height_um;  // thickness that is left of the open layer [um]
    float strength;   // part that is taken from its width
};

struct Pigment {
    float thickness;  // thickness that comes on [um]
    vec3 K;           // absorption of diffuse light [1/um]
    vec3 S;           // scattering of diffuse light [1/um]
    float alpha;      // width of the facet slopes of its boundary
    float eta;        // index of refraction, against air
    float escape;     // part of diffuse light from below that passes its boundary
};

struct Growth {
    float theta;      // value of the field up to which the surface is covered
    float age;        // age, in onset times
    float steepness;  // exponent of the age
    float softness;   // width of the edge, in the unit of the field
    float cells;      // cells of the coarsest noise in a unit of texture
    float seed;       // which noise: a whole number
};

struct Conductor {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

struct Cover {
    float covered;  // part that is covered
    float bare;     // part that is not: 1 - covered, without the cancellation
};

struct TwoFlux {
    vec3 R;  // part that it sends back
    vec3 T;  // part that it lets through
};

const Polish lf_rub = Polish(
    6.0,  // height_um: thickness that is left of the open layer [um]
    0.5   // strength: part that is taken from its width
);

const Pigment lf_verdigris_pigment = Pigment(
    40.0,                                   // thickness: thickness that comes on [um]
    vec3(0.07, 0.012, 0.020000001),         // K: absorption of diffuse light [1/um]
    vec3(0.020000001, 0.030000001, 0.026),  // S: scattering of diffuse light [1/um]
    0.6,                                    // alpha: width of the facet slopes of its boundary
    1.6,                                    // eta: index of refraction, against air
    0.34912282                              // escape: part of diffuse light from below that passes its boundary
);

const Pigment lf_tarnish_pigment = Pigment(
    2.0,                                    // thickness: thickness that comes on [um]
    vec3(0.040000003, 0.075, 0.120000005),  // K: absorption of diffuse light [1/um]
    vec3(0.004, 0.003, 0.002),              // S: scattering of diffuse light [1/um]
    0.35,                                   // alpha: width of the facet slopes of its boundary
    1.6,                                    // eta: index of refraction, against air
    0.34912282                              // escape: part of diffuse light from below that passes its boundary
);

const Growth lf_verdigris_growth = Growth(
    0.38988382,  // theta: value of the field up to which the surface is covered
    0.625,       // age: age, in onset times
    1.5,         // steepness: exponent of the age
    0.03,        // softness: width of the edge, in the unit of the field
    5.0,         // cells: cells of the coarsest noise in a unit of texture
    0.0          // seed: which noise: a whole number
);

const Conductor lf_brass = Conductor(
    0.25,                       // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(0.482, 0.523, 1.127),  // eta: index of refraction, real part
    vec3(4.377, 2.667, 1.813)   // k: index of refraction, imaginary part
);

const vec3 lf_brass_albedo = vec3(0.8749448, 0.7256623, 0.35941297);

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

// Part of a place where a layer of this thickness [um] is too thin to have a boundary of its own.
float lf_see_through(float thickness) {
    return exp(-thickness / 0.5);
}

// A layer that absorbs (Kx >= 0) and scatters (Sx >= 0) diffuse light, over nothing (Kubelka 1948).
TwoFlux lf_kubelka_munk(vec3 Kx, vec3 Sx) {
    vec3 z2 = Kx * (Kx + 2.0 * Sx);
    vec3 sinh_z2 = 1.0 + z2 / 6.0 * (1.0 + z2 / 20.0 * (1.0 + z2 / 42.0 * (1.0 + z2 / 72.0 * (1.0 + z2 / 110.0))));
    vec3 cosh_z2 = 1.0 + z2 / 2.0 * (1.0 + z2 / 12.0 * (1.0 + z2 / 30.0 * (1.0 + z2 / 56.0 * (1.0 + z2 / 90.0))));
    vec3 whole = (Kx + Sx) * sinh_z2 + cosh_z2;
    return TwoFlux(Sx * sinh_z2 / whole, 1.0 / whole);
}

// Albedo of a layer over a substrate of a given albedo (Kubelka 1948).
vec3 lf_kubelka_munk_over(TwoFlux layer, vec3 substrate) {
    return layer.R + layer.T * layer.T * substrate / (1.0 - layer.R * substrate);
}

// A layer that absorbs (Kx >= 0) and scatters (Sx >= 0) diffuse light, over nothing (Kubelka 1948).
TwoFlux lf_kubelka_munk2(vec3 Kx, vec3 Sx) {
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

// Albedo of a layer over a substrate of a given albedo (Kubelka 1948).
vec3 lf_kubelka_munk_over2(TwoFlux layer, vec3 substrate) {
    return layer.R + layer.T * layer.T * substrate / max(1.0 - layer.R * substrate, 1e-06);
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
    bool refracts = g2 > 1e-08;
    float g = sqrt(refracts ? g2 : 1.0);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float rs = perpendicular * perpendicular;
    float rp = ((eta2 + 1.0) * (c * c) - 1.0) * (parallel * parallel);
    float reflectance = 0.5 * (delta * delta) * (rs * rs + rp * rp);
    float value = refracts ? reflectance : 1.0;
    return eta == 1.0 ? 0.0 : value;
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
    return sqrt(max(a2 + (1.0 - a2) * (w.cosine * w.cosine), 0.0));
}

// D V, the GGX density (Walter et al. 2007, eq. 33) and height-correlated Smith masking (Heitz 2014, eq. 99), by one division.
float lf_ggx_lobe(FreeDirection wi, FreeDirection wo, FreeDirection h, float alpha) {
    float a2 = alpha * alpha;
    float e = dot(h.along, h.along) + a2 * (h.cosine * h.cosine);
    float hidden = wo.cosine * lf_ggx_projection(wi, alpha) + wi.cosine * lf_ggx_projection(wo, alpha);
    return 0.15915494 * a2 / (e * e * hidden);
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric(float c, float eta) {
    float g = sqrt(max((eta - 1.0) * (eta + 1.0) + c * c, 0.0));
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / max(eta2 * c + g, 1e-14);
    float passed = 2.0 * c * g * (perpendicular * perpendicular + eta2 * (parallel * parallel));
    return eta == 1.0 ? 1.0 : passed;
}

// BRDF [1/sr] of a diffuse body of this albedo below a smooth boundary (Saunderson 1942, per direction).
vec3 lf_below_boundary(FreeDirection wi, FreeDirection wo, float eta, float escape, vec3 albedo) {
    float T = lf_transmittance_dielectric(wi.cosine, eta) * lf_transmittance_dielectric(wo.cosine, eta);
    vec3 kept = max(1.0 - albedo + albedo * escape, 1e-06);
    return T / (eta * eta) * (albedo / 3.1415927) / kept;
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

// NoW (1 + 2 Lambda) of the GGX distribution (Heitz 2014, eq. 72, multiplied out).
float lf_ggx_projection2(FreeDirection w, float alpha) {
    float a2 = alpha * alpha;
    return sqrt(a2 + (1.0 - a2) * (w.cosine * w.cosine));
}

// D V, the GGX density (Walter et al. 2007, eq. 33) and height-correlated Smith masking (Heitz 2014, eq. 99), by one division.
float lf_ggx_lobe2(FreeDirection wi, FreeDirection wo, FreeDirection h, float alpha) {
    float a2 = alpha * alpha;
    float e = dot(h.along, h.along) + a2 * (h.cosine * h.cosine);
    float hidden = wo.cosine * lf_ggx_projection2(wi, alpha) + wi.cosine * lf_ggx_projection2(wo, alpha);
    return 0.15915494 * a2 / (e * e * hidden);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo, vec2 uv) {
    Cover cover = lf_cover_at(lf_field_at(uv, lf_verdigris_growth), lf_verdigris_growth);
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float t = cover.covered * lf_verdigris_pigment.thickness;
    float through = lf_see_through(t);
    float share = 1.0 - through;
    float through2 = lf_see_through(lf_tarnish_pigment.thickness);
    float share2 = through * (1.0 - through2);
    float thickness = lf_tarnish_pigment.thickness - share2 * 0.0;
    float alpha = lf_tarnish_pigment.alpha * (1.0 - lf_rub.strength * share2);
    float thickness2 = t - share * max(t - lf_rub.height_um, 0.0);
    float alpha2 = lf_verdigris_pigment.alpha * (1.0 - lf_rub.strength * share);
    through = lf_see_through(thickness2);
    share = 1.0 - through;
    through2 = lf_see_through(thickness);
    share2 = through * (1.0 - through2);
    float bare = through * through2;
    float covered = share2 + share;
    t = share / max(covered, 1e-14);
    float t2 = 1.0 - t;
    alpha = t2 * alpha + t * alpha2;
    float eta = t2 * lf_tarnish_pigment.eta + t * lf_verdigris_pigment.eta;
    float escape = t2 * lf_tarnish_pigment.escape + t * lf_verdigris_pigment.escape;
    TwoFlux layer = lf_kubelka_munk(lf_tarnish_pigment.K * thickness, lf_tarnish_pigment.S * thickness);
    vec3 albedo = lf_kubelka_munk_over(layer, lf_brass_albedo);
    layer = lf_kubelka_munk2(lf_verdigris_pigment.K * thickness2, lf_verdigris_pigment.S * thickness2);
    albedo = lf_kubelka_munk_over2(layer, albedo);
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), eta);
    FreeDirection direction = lf_half_vector(wi, wo);
    float boundary = F * lf_ggx_lobe(wi, wo, direction, alpha);
    vec3 body = lf_below_boundary(wi, wo, eta, escape, albedo);
    vec3 F2 = lf_fresnel_conductor(lf_half_cosine(wi, wo), lf_brass.eta, lf_brass.k);
    direction = lf_half_vector(wi, wo);
    vec3 metal = F2 * lf_ggx_lobe2(wi, wo, direction, lf_brass.alpha);
    vec3 f = covered * (boundary + body) + bare * metal;
    return lit ? f : vec3(0.0);
}

// BRDF [1/sr] in any frame: an isotropic surface asks for no tangent.
vec3 lf_brdf(vec3 n, vec3 v, vec3 l, vec2 uv) {
    float NoL = dot(n, l);
    float NoV = dot(n, v);
    return lf_evaluate(FreeDirection(l - NoL * n, NoL), FreeDirection(v - NoV * n, NoV), uv);
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
    vec3 radiance = vec3(0.0);
    for (int k = 0; k < LF_LIGHTS; ++k) {
        vec3 l;
        vec3 irradiance = lf_light(u_light[k], u_light_rgb[k], v_position, l);
        radiance += lf_brdf(n, v, l, uv) * irradiance * max(dot(n, l), 0.0);
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
