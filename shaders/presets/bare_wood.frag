#version 330 core
// bare_wood: OrenNayar.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct OrenNayar {
    vec3 albedo;  // part of the light that is sent back
    float sigma;  // standard deviation of the facet angle [rad]
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

const OrenNayar lf_wood = OrenNayar(
    vec3(0.53, 0.3, 0.14),  // albedo: part of the light that is sent back
    0.25                    // sigma: standard deviation of the facet angle [rad]
);

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

// Oren and Nayar 1994, eqs. 25 to 29: diffuse grooves with one interreflection.
vec3 lf_oren_nayar_full(FreeDirection wi, FreeDirection wo, vec3 albedo, float sigma) {
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
    vec3 value = lf_oren_nayar_full(wi, wo, lf_wood.albedo, lf_wood.sigma);
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
