//@ header
//@ material
in vec3 v_normal;
in vec3 v_view;
//@ if tangent
in vec3 v_tangent;
//@ end
//@ if uv
in vec2 v_uv;
//@ end
//@ if distance
in float v_distance;
//@ end
//@ if sky
in float v_sky;
//@ end
out vec4 color;

uniform vec3 u_to_light[LF_LIGHTS];
uniform vec3 u_irradiance[LF_LIGHTS];

void main() {
    vec3 n = normalize(v_normal);
    vec3 v = normalize(v_view);
//@ if uv
    vec2 uv = v_uv;
//@ end
//@ if distance
    float distance = v_distance;
//@ end
//@ if sky
    float sky = v_sky;
//@ end
    vec3 radiance = vec3(0.0);
    //@ light
//@ if tangent
    radiance += lf_brdf(n, v_tangent, v, u_to_light[@LIGHT@]@THERE@) * u_irradiance[@LIGHT@] * max(dot(n, u_to_light[@LIGHT@]), 0.0);
//@ else
    radiance += lf_brdf(n, v, u_to_light[@LIGHT@]@THERE@) * u_irradiance[@LIGHT@] * max(dot(n, u_to_light[@LIGHT@]), 0.0);
//@ end
    color = vec4(radiance, 1.0);
}
