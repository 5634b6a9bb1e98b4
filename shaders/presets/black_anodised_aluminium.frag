#version 330 core
// black_anodised_aluminium: Coat over Conductor.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: nothing.
// Indices of refraction are relative to the layer above: its own index divides those in the preset.
//
// vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha_x;  // width of the facet slopes along the tangent; the square of an artist's roughness
    float alpha_y;  // width of the facet slopes across the tangent; the square of an artist's roughness
    float eta;      // index of refraction, against air
    vec3 tau;       // optical depth, one way at normal incidence
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
    float alpha_x;  // width of the facet slopes along the tangent; the square of an artist's roughness
    float alpha_y;  // width of the facet slopes across the tangent; the square of an artist's roughness
    vec3 eta;       // index of refraction, real part
    vec3 k;         // index of refraction, imaginary part
};

struct Crossing {
    vec3 w;             // direction in the medium below
    float T;            // energy that passes
    float spread;       // width of the refracted directions over that of the facets
    float lengthening;  // path beyond that of the refracted direction, in thicknesses
    float drift;        // the part of it due to grazing incidence
};

const Coat lf_oxide = Coat(
    0.12,                             // alpha_x: width of the facet slopes along the tangent; the square of an artist's roughness
    0.3,                              // alpha_y: width of the facet slopes across the tangent; the square of an artist's roughness
    1.65,                             // eta: index of refraction, against air
    vec3(1.1, 1.1200001, 1.1600001)   // tau: optical depth, one way at normal incidence
);

const Interface lf_oxide_interface = Interface(
    1.65,         // n: index of the medium below, against air
    0.18973666,   // alpha: width of the facets, mean of the axes
    0.048903294,  // tilt: turn of the mean facet towards a grazing direction
    0.108719915,  // gain: part of the reflected light that a second facet lets in
    0.010551541,  // lengthening: path added by the spread of refracted directions, in thicknesses
    1.9856877     // drift: scale of the path added at grazing angles
);

const Conductor lf_aluminium = Conductor(
    0.12,                                    // alpha_x: width of the facet slopes along the tangent; the square of an artist's roughness
    0.35,                                    // alpha_y: width of the facet slopes across the tangent; the square of an artist's roughness
    vec3(0.9115151, 0.59818184, 0.3678788),  // eta: index of refraction, real part
    vec3(4.641212, 3.9733336, 3.2454545)     // k: index of refraction, imaginary part
);

// The cosine between either direction and their half vector.
float lf_half_cosine(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return min(0.5 * sqrt(max(dot(s, s), 0.0)), 1.0);
}

// Exact reflectance of a dielectric boundary (Born and Wolf 1999, 1.5.2); 1 under total internal reflection.
float lf_fresnel_dielectric(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g2 = delta + c * c;
    bool refracts = g2 > 1e-08;
    float g = sqrt(refracts ? g2 : 1.0);
    float eta2 = eta * eta;
    float perpendicular = (c + g) * (c + g);
    float parallel = (eta2 * c + g) * (eta2 * c + g);
    float rs = -delta / perpendicular;
    float rp = delta * ((eta2 + 1.0) * c * c - 1.0) / parallel;
    float reflectance = 0.5 * (rs * rs + rp * rp);
    return eta == 1.0 ? 0.0 : (refracts ? reflectance : 1.0);
}

// The unit vector halfway between two directions on the same side of the surface.
vec3 lf_half_vector(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    return s / sqrt(max(dot(s, s), 1e-20));
}

// Anisotropic GGX density of facet normals (Burley 2012, eq. 13).
float lf_ggx_d_anisotropic(vec3 h, float alpha_x, float alpha_y) {
    float x = h.x / alpha_x;
    float y = h.y / alpha_y;
    float e = x * x + y * y + h.z * h.z;
    return 1.0 / (3.1415927 * alpha_x * alpha_y * e * e);
}

// NoW (1 + 2 Lambda) of the anisotropic GGX distribution (Heitz 2014, eqs. 72 and 80).
float lf_ggx_projection_anisotropic(vec3 w, float alpha_x, float alpha_y) {
    float x = alpha_x * w.x;
    float y = alpha_y * w.y;
    return sqrt(max(w.z * w.z + x * x + y * y, 0.0));
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / max(NoV * projection_l + NoL * projection_v, 1e-14);
}

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(vec3 w, float tilt) {
    return sqrt(max(w.z * w.z + tilt * (w.x * w.x + w.y * w.y), 0.0));
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric(float c, float eta) {
    float g = sqrt(max((eta - 1.0) * (eta + 1.0) + c * c, 0.0));
    float eta2 = eta * eta;
    float perpendicular = c + g;
    float parallel = eta2 * c + g;
    float product = 2.0 * c * g;
    float passed = product / max(perpendicular * perpendicular, 1e-14) + product * eta2 / max(parallel * parallel, 1e-14);
    return eta == 1.0 ? 1.0 : passed;
}

// Energy that passes a rough interface, from what passes the mean facet; `gain` is `second_facet`.
float lf_with_second_facet(float T, float gain) {
    return T + (1.0 - T) * gain;
}

// Path added near grazing angles, where the facets that face the light take most of it.
float lf_drift(vec3 w, float scale, float alpha) {
    float one_minus = (w.x * w.x + w.y * w.y) / (1.0 + w.z);
    return scale * pow(max(one_minus, 1e-30), 3.16) * exp(-7.0 * alpha * one_minus);
}

// Direction below a boundary of relative index `eta` (Snell's law); its z is 0 under total internal reflection.
vec3 lf_refract_about_normal(vec3 w, float eta) {
    float z2 = (eta - 1.0) * (eta + 1.0) + w.z * w.z;
    return vec3(w.x, w.y, sqrt(max(z2, 0.0))) / eta;
}

// Width of the refracted directions over the width of the facets, to first order in slope.
float lf_slope_spread(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g = sqrt(max(delta + c * c, 0.0));
    return 0.5 * abs(delta) / max(g * (g + c), 1e-14);
}

// Follow one direction through the rough top of a coat with its relative index; `air` is the direction above all of them.
Crossing lf_cross(Interface interface_, Coat coat, vec3 w, vec3 air) {
    float c = lf_facet_cosine(w, interface_.tilt);
    float c_energy = coat.eta >= 1.0 ? c : w.z;
    float T = lf_with_second_facet(lf_transmittance_dielectric(c_energy, coat.eta), interface_.gain);
    float grazing = lf_drift(w, interface_.drift, interface_.alpha);
    vec3 below = lf_refract_about_normal(air, interface_.n);
    return Crossing(below, T, lf_slope_spread(c, coat.eta), interface_.lengthening + grazing, grazing);
}

// Bouguer, Lambert and Beer: what remains after `path` times the optical depth at normal incidence.
vec3 lf_transmittance(vec3 tau, float path) {
    return exp(-(tau * path));
}

// Turn a direction, azimuth kept, until its path 1 / w.z is longer by `lengthening`.
vec3 lf_steer(vec3 w, float lengthening) {
    float z = w.z / max(1.0 + lengthening * w.z, 1e-14);
    float sine2 = w.x * w.x + w.y * w.y;
    float growth = lengthening * z * w.z * (w.z + z) / max(sine2, 1e-14);
    float ratio = sqrt(max(1.0 + growth, 0.0));
    return vec3(w.x * ratio, w.y * ratio, z);
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor(float c, vec3 eta, vec3 k) {
    float c2 = c * c;
    float s2 = (1.0 - c) * (1.0 + c);
    vec3 p = (eta - k) * (eta + k) - s2;
    vec3 nk = eta * k;
    vec3 q = sqrt(max(p * p + 4.0 * nk * nk, 1e-24));
    vec3 larger = sqrt(0.5 * (q + abs(p)));
    vec3 a = mix(larger, nk / larger, lessThan(p, vec3(0.0)));
    vec3 twice_ac = 2.0 * a * c;
    vec3 rs = (q + c2 - twice_ac) / max(q + c2 + twice_ac, 1e-12);
    float s4 = s2 * s2;
    vec3 even = q * c2 + s4;
    vec3 odd = twice_ac * s2;
    vec3 rp = rs * (even - odd) / max(even + odd, 1e-12);
    return 0.5 * (rs + rp);
}

// Part of a lobe of width alpha that leaves the escape cone: sine in air, cosine in the medium of index n.
float lf_edge_reflection(float sine, float cosine, float n, float alpha) {
    float m = 0.5 * (1.0 - sine) / max(n * cosine, 1e-14);
    return n > 1.0 ? 0.5 - 0.5 * m / max(sqrt(max(alpha * alpha + m * m, 0.0)), 1e-14) : 0.0;
}

// BRDF [1/sr] of unit directions in the surface frame, normal (0, 0, 1); without the cosine.
vec3 lf_evaluate(vec3 wi, vec3 wo) {
    bool lit = wi.z > 0.0 && wo.z > 0.0;
    wi = lit ? wi : vec3(0.0, 0.0, 1.0);
    wo = lit ? wo : vec3(0.0, 0.0, 1.0);
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_oxide.eta);
    float D = lf_ggx_d_anisotropic(lf_half_vector(wi, wo), lf_oxide.alpha_x, lf_oxide.alpha_y);
    float projection_i = lf_ggx_projection_anisotropic(wi, lf_oxide.alpha_x, lf_oxide.alpha_y);
    float projection_o = lf_ggx_projection_anisotropic(wo, lf_oxide.alpha_x, lf_oxide.alpha_y);
    float V = lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    float f = F * D * V;
    Crossing i = lf_cross(lf_oxide_interface, lf_oxide, wi, wi);
    Crossing o = lf_cross(lf_oxide_interface, lf_oxide, wo, wo);
    float throughput = i.T * o.T / (lf_oxide.eta * lf_oxide.eta);
    float straight = 1.0 / max(i.w.z, 1e-14) + 1.0 / max(o.w.z, 1e-14);
    float added = i.lengthening + o.lengthening;
    float sin_i = sqrt(max(wi.x * wi.x + wi.y * wi.y, 0.0));
    float sin_o = sqrt(max(wo.x * wo.x + wo.y * wo.y, 0.0));
    float R_i = 1.0 - i.T;
    float R_o = 1.0 - o.T;
    vec3 directional = lf_transmittance(lf_oxide.tau, straight + 0.5 * added);
    wi = lf_steer(i.w, 0.5 * i.drift);
    wo = lf_steer(o.w, 0.5 * o.drift);
    vec3 h = lf_half_vector(wi, wo);
    vec3 F2 = lf_fresnel_conductor(lf_half_cosine(wi, wo), lf_aluminium.eta, lf_aluminium.k);
    float R = 0.5 * (R_i + R_o);
    float alpha = sqrt(max(lf_aluminium.alpha_x * lf_aluminium.alpha_y, 0.0));
    float edge_i = lf_edge_reflection(sin_i, i.w.z, lf_oxide_interface.n, alpha);
    float edge_o = lf_edge_reflection(sin_o, o.w.z, lf_oxide_interface.n, alpha);
    vec3 q = F2 * (R + (1.0 - R) * (0.5 * (edge_i + edge_o))) * directional;
    float spread = (pow(max(i.spread, 1e-30), 1.34) + pow(max(o.spread, 1e-30), 1.34)) * pow(max(lf_oxide.alpha_x, 1e-30), 1.34);
    float spread2 = (pow(max(i.spread, 1e-30), 1.34) + pow(max(o.spread, 1e-30), 1.34)) * pow(max(lf_oxide.alpha_y, 1e-30), 1.34);
    float total = spread + 3.0 * pow(max(lf_aluminium.alpha_x, 1e-30), 1.34);
    total = total + 2.0 * pow(max(lf_oxide.alpha_x, 1e-30), 1.34);
    float width = min(pow(max(total, 1e-30), 0.74626863), 1.5);
    total = spread2 + 3.0 * pow(max(lf_aluminium.alpha_y, 1e-30), 1.34);
    total = total + 2.0 * pow(max(lf_oxide.alpha_y, 1e-30), 1.34);
    float width2 = min(pow(max(total, 1e-30), 0.74626863), 1.5);
    D = lf_ggx_d_anisotropic(h, width, width2);
    projection_i = lf_ggx_projection_anisotropic(wi, width, width2);
    projection_o = lf_ggx_projection_anisotropic(wo, width, width2);
    V = lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    float lobe = D * V;
    vec3 lobes = lobe / max(1.0 - q, 1e-06);
    total = spread + 2.0 * pow(max(lf_aluminium.alpha_x, 1e-30), 1.34);
    total = total + pow(max(lf_oxide.alpha_x, 1e-30), 1.34);
    width = min(pow(max(total, 1e-30), 0.74626863), 1.5);
    total = spread2 + 2.0 * pow(max(lf_aluminium.alpha_y, 1e-30), 1.34);
    total = total + pow(max(lf_oxide.alpha_y, 1e-30), 1.34);
    width2 = min(pow(max(total, 1e-30), 0.74626863), 1.5);
    D = lf_ggx_d_anisotropic(h, width, width2);
    projection_i = lf_ggx_projection_anisotropic(wi, width, width2);
    projection_o = lf_ggx_projection_anisotropic(wo, width, width2);
    V = lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    lobe = D * V;
    lobes = lobe + q * lobes;
    total = spread + pow(max(lf_aluminium.alpha_x, 1e-30), 1.34);
    width = min(pow(max(total, 1e-30), 0.74626863), 1.5);
    total = spread2 + pow(max(lf_aluminium.alpha_y, 1e-30), 1.34);
    width2 = min(pow(max(total, 1e-30), 0.74626863), 1.5);
    D = lf_ggx_d_anisotropic(h, width, width2);
    projection_i = lf_ggx_projection_anisotropic(wi, width, width2);
    projection_o = lf_ggx_projection_anisotropic(wo, width, width2);
    V = lf_v_smith(wi.z, wo.z, projection_i, projection_o);
    lobe = D * V;
    lobes = lobe + q * lobes;
    vec3 f2 = f + throughput * directional * F2 * lobes;
    return lit ? f2 : vec3(0.0);
}

// BRDF [1/sr] in any frame; t is a tangent, along which alpha_x is measured.
vec3 lf_brdf(vec3 n, vec3 t, vec3 v, vec3 l) {
    vec3 x = normalize(t - dot(t, n) * n);
    mat3 surface = transpose(mat3(x, cross(n, x), n));
    return lf_evaluate(surface * l, surface * v);
}

#ifndef LF_LIBRARY

#ifndef LF_LIGHTS
#define LF_LIGHTS 1
#endif

in vec3 v_position;  // this, u_eye and u_light in one space, such as the world's
in vec3 v_normal;
in vec3 v_tangent;   // along which widths and patterns are measured
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
        radiance += lf_brdf(n, v_tangent, v, l) * irradiance * max(dot(n, l), 0.0);
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
