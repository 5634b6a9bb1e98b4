//@ header
//@ about
//
// vec3 lf_brdf(@FRAME@) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

//@ material

#ifndef LF_LIBRARY

#ifndef LF_LIGHTS
#define LF_LIGHTS 1
#endif

in vec3 v_position;  // this, u_eye and u_light in one space, such as the world's
in vec3 v_normal;
//@ if tangent
in vec3 v_tangent;   // along which widths and patterns are measured
//@ end
//@ if at_uv
in vec2 v_uv;        // texture coordinates
//@ end
out vec4 color;

uniform vec3 u_eye;
//@ if sky
uniform vec3 u_up;  // where the sky is, a unit vector
//@ end
uniform vec4 u_light[LF_LIGHTS];      // w = 0: direction to a distant light; w = 1: position of a point light
uniform vec3 u_light_rgb[LF_LIGHTS];  // its irradiance; its intensity per steradian
//@ if maps
//@ textures
//@ end
//@ if tilt
uniform sampler2D u_tilt;  // slopes of the normal, along the tangent and across it
//@ end

//@ lights

//@ if tilt
//@ tilted

//@ end
//@ output

void main() {
    vec3 n = normalize(v_normal);
//@ if tilt
    n = lf_tilted(n@ALONG@, texture(u_tilt, v_uv).rg);
//@ end
    vec3 v = normalize(u_eye - v_position);
//@ if uv
    vec2 uv = v_uv;
//@ end
//@ if maps
//@ texels
//@ end
//@ if distance
    float distance = length(u_eye - v_position);  // in the unit of the space above
//@ end
//@ if sky
    float sky = 0.5 + 0.5 * dot(n, u_up);  // part of it that is seen in the open; times ambient occlusion, where you have it
//@ end
    vec3 radiance = vec3(0.0);
    for (int k = 0; k < LF_LIGHTS; ++k) {
        vec3 l;
        vec3 irradiance = lf_light(u_light[k], u_light_rgb[k], v_position, l);
//@ if tangent
        radiance += lf_brdf(n, v_tangent, v, l@THERE@) * irradiance * max(dot(n, l), 0.0);
//@ else
        radiance += lf_brdf(n, v, l@THERE@) * irradiance * max(dot(n, l), 0.0);
//@ end
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
