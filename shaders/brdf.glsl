//@ if tangent
// BRDF [1/sr] in any frame; t is a tangent, along which alpha_x is measured.
vec3 lf_brdf(@FRAME@) {
    vec3 x = normalize(t - dot(t, n) * n);
    mat3 surface = transpose(mat3(x, cross(n, x), n));
    return lf_evaluate(surface * l, surface * v@THERE@);
}
//@ else
// BRDF [1/sr] in any frame.
vec3 lf_brdf(@FRAME@) {
    // A tangent frame from the normal alone (Duff et al. 2017): an isotropic surface does not ask which.
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    mat3 surface = transpose(mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n));
    return lf_evaluate(surface * l, surface * v@THERE@);
}
//@ end
