//@ header
//@ material
in vec3 v_wi;
in vec3 v_wo;
in vec3 v_weight;
out vec4 color;

void main() {
    color = vec4(lf_evaluate(v_wi, v_wo) * v_weight, 1.0);
}
