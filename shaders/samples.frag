//@ header
//@ material
in vec3 v_wi;
in vec3 v_wo;
in vec3 v_weight;
//@ if uv
in vec2 v_uv;
//@ end
//@ if distance
in float v_distance;
//@ end
//@ if sky
in float v_sky;
//@ end
//@ if maps
//@ given
//@ end
out vec4 color;

void main() {
//@ if uv
    vec2 uv = v_uv;
//@ end
//@ if distance
    float distance = v_distance;
//@ end
//@ if sky
    float sky = v_sky;
//@ end
//@ if maps
//@ taken
//@ end
//@ if cosines
    vec2 lean = v_wi.xy + v_wo.xy;
    color = vec4(lf_shade(v_wi.z, v_wo.z, dot(lean, lean)) * v_weight, 1.0);
//@ end
//@ if tangent
    color = vec4(lf_evaluate(v_wi, v_wo@THERE@) * v_weight, 1.0);
//@ end
//@ if free
    color = vec4(lf_evaluate(FreeDirection(vec3(v_wi.xy, 0.0), v_wi.z), FreeDirection(vec3(v_wo.xy, 0.0), v_wo.z)@THERE@) * v_weight, 1.0);
//@ end
}
