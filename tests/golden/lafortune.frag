#version 330 core
// lafortune: Lafortune.
// Printed by layerfit 0.1.0 from its corrected form.
// Left out, because this material does without: coat.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Lafortune {
    vec3 kd;         // diffuse part
    float ks;        // strength of the lobe [1/sr]
    float cx;        // weight of the product of the components along the tangent
    float cz;        // weight of the product of the cosines
    float exponent;  // exponent of the lobe; large is narrow
};

struct FreeDirection {
    vec3 along;    // part along the surface, in any space
    float cosine;  // cosine to its normal
};

const Lafortune lf_base = Lafortune(
    vec3(0.5, 0.28, 0.13),  // kd: diffuse part
    0.6,                    // ks: strength of the lobe [1/sr]
    -1.0,                   // cx: weight of the product of the components along the tangent
    0.97,                   // cz: weight of the product of the cosines
    30.0                    // exponent: exponent of the lobe; large is narrow
);

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

// log(Cx wi.x wo.x + Cy wi.y wo.y + Cz wi.z wo.z), which is 0 at the peak of Phong's lobe; -1e4 where there is none.
float lf_lafortune_log_product(FreeDirection wi, FreeDirection wo, vec3 C) {
    vec4 wi2 = vec4(wi.along, wi.cosine);
    vec4 wo2 = vec4(wo.along, wo.cosine);
    vec4 C2 = vec4(C.x, C);
    vec4 magnitude = abs(C2);
    vec4 apart = wi2 - sign(C2) * wo2;
    vec4 above_one = 0.5 * ((magnitude - 1.0) * (wi2 * wi2 + wo2 * wo2) - magnitude * (apart * apart));
    float product = dot(above_one, vec4(1.0));
    bool inside = product > (-0.999999);
    float value = lf_log1p(inside ? product : 0.0);
    return inside ? value : (-10000.0);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(FreeDirection wi, FreeDirection wo) {
    bool lit = min(wi.cosine, wo.cosine) > 1e-07;
    float log_product = lf_lafortune_log_product(wi, wo, vec3(lf_base.cx, lf_base.cx, lf_base.cz));
    vec3 value = lf_base.ks * exp(min(lf_base.exponent * log_product, 60.0)) + lf_base.kd / 3.1415927;
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
