#version 330 core
// sparkling_silver_car_paint: CarPaint.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat.
//
// vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l, vec2 uv, float distance) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct CarPaint {
    vec3 kd;              // diffuse part
    vec3 ks;              // strength of the lobe
    float f0;             // reflectance of its facets at the normal
    float alpha;          // width of the facet slopes of the lobe; the square of an artist's roughness
    float sparkle;        // part of the spread of slopes that is from flake to flake; absent: none
    vec3 ks_2;            // strength of the lobe
    float f0_2;           // reflectance of its facets at the normal
    float alpha_2;        // width of the facet slopes of the second lobe; the square of an artist's roughness
    float sparkle_2;      // part of the spread of slopes of the second lobe that is from flake to flake; absent: none
    vec3 ks_3;            // strength of the lobe
    float f0_3;           // reflectance of its facets at the normal
    float alpha_3;        // width of the facet slopes of the third lobe; the square of an artist's roughness
    float per_uv;         // flakes along one unit of the texture coordinates
    float half_distance;  // distance at which half of the tilt is drawn, in the scene's unit
    float seed;           // whole number; another one, other flakes
};

const CarPaint lf_paint = CarPaint(
    vec3(0.055, 0.063, 0.071),  // kd: diffuse part
    vec3(0.065, 0.082, 0.088),  // ks: strength of the lobe
    1.0,                        // f0: reflectance of its facets at the normal
    0.38,                       // alpha: width of the facet slopes of the lobe; the square of an artist's roughness
    0.6,                        // sparkle: part of the spread of slopes that is from flake to flake; absent: none
    vec3(0.11, 0.11, 0.13),     // ks_2: strength of the lobe
    0.92,                       // f0_2: reflectance of its facets at the normal
    0.17,                       // alpha_2: width of the facet slopes of the second lobe; the square of an artist's roughness
    0.8,                        // sparkle_2: part of the spread of slopes of the second lobe that is from flake to flake; absent: none
    vec3(0.008, 0.013, 0.015),  // ks_3: strength of the lobe
    0.9,                        // f0_3: reflectance of its facets at the normal
    0.013,                      // alpha_3: width of the facet slopes of the third lobe; the square of an artist's roughness
    300.0,                      // per_uv: flakes along one unit of the texture coordinates
    8.0,                        // half_distance: distance at which half of the tilt is drawn, in the scene's unit
    7.0                         // seed: whole number; another one, other flakes
);

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

// The unit vector halfway between two directions on the same side of the surface.
vec3 lf_half_vector(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    float inverse = inversesqrt(dot(s, s));
    return s * inverse;
}

// The cosine between either direction and their half vector.
float lf_half_cosine(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return 0.5 * sqrt(dot(s, s));
}

// Schlick 1994, eq. 15, from the reflectance at normal incidence.
float lf_fresnel_schlick(float c, float f0) {
    float m = 1.0 - c;
    float m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
}

// G / (4 NoL NoV), V-shaped grooves (Torrance and Sparrow 1967; Cook and Torrance 1982, eq. 10).
float lf_v_cavity(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    float NoH_over_c = 2.0 * s.z / dot(s, s);
    return min(0.25 / max(wi.z * wo.z, 1e-14), 0.5 * NoH_over_c / max(wi.z, wo.z));
}

// Density of a tilted flake's facet normals, their squared width alpha2: Beckmann's, moved among slopes (Olano and Baker 2010, eq. 7).
float lf_tilted_d(vec3 h, vec2 tilt, float alpha2) {
    float x = h.x - h.z * tilt.x;
    float y = h.y - h.z * tilt.y;
    bool above = h.z > 1e-04;
    float value = h.z * h.z;
    float inverse = 1.0 / (above ? value : 1.0);
    value = exp(-((x * x + y * y) / alpha2) * inverse) * (inverse * inverse) / (3.1415927 * alpha2);
    return above ? value : 0.0;
}

// Beckmann density of facet normals (Cook and Torrance 1982, eq. 14, normalised).
float lf_beckmann_d(vec3 h, float alpha) {
    bool above = h.z > 1e-04;
    float value = h.z * h.z;
    float inverse = 1.0 / (above ? value : 1.0);
    value = exp(-(dot(h.xy, h.xy) / (alpha * alpha)) * inverse) * (inverse * inverse) / (3.1415927 * (alpha * alpha));
    return above ? value : 0.0;
}

// BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine.
vec3 lf_evaluate(vec3 wi, vec3 wo, vec2 uv, float distance) {
    float kept = lf_kept_tilt(distance, lf_paint.half_distance);
    vec2 slope = lf_flake_tilt(uv, lf_paint.per_uv, kept, uint(lf_paint.seed));
    float lost = lf_lost_variance(distance, lf_paint.half_distance);
    bool lit = min(wi.z, wo.z) > 1e-07;
    vec3 h = lf_half_vector(wi, wo);
    float c = lf_half_cosine(wi, wo);
    float V = lf_v_cavity(wi, wo);
    float whole = lf_paint.alpha * lf_paint.alpha;
    float own = whole * (1.0 - lf_paint.sparkle) + lost * (lf_paint.sparkle * whole);
    float V2 = lf_v_cavity(wi, wo);
    whole = lf_paint.alpha_2 * lf_paint.alpha_2;
    float own2 = whole * (1.0 - lf_paint.sparkle_2) + lost * (lf_paint.sparkle_2 * whole);
    float V3 = lf_v_cavity(wi, wo);
    float D = lf_beckmann_d(h, lf_paint.alpha_3);
    vec3 value = 4.0 * lf_paint.ks * lf_fresnel_schlick(c, lf_paint.f0) * (lf_tilted_d(h, sqrt(lf_paint.sparkle) * lf_paint.alpha * slope, own) * V) + 4.0 * lf_paint.ks_2 * lf_fresnel_schlick(c, lf_paint.f0_2) * (lf_tilted_d(h, sqrt(lf_paint.sparkle_2) * lf_paint.alpha_2 * slope, own2) * V2) + 4.0 * lf_paint.ks_3 * lf_fresnel_schlick(c, lf_paint.f0_3) * (D * V3) + lf_paint.kd / 3.1415927;
    return lit ? value : vec3(0.0);
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
