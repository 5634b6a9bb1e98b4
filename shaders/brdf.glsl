//@ if tangent
// BRDF [1/sr] in any frame; t is a tangent, along which alpha_x is measured.
vec3 lf_brdf(@FRAME@) {
    vec3 x = normalize(t - dot(t, n) * n);
    mat3 surface = transpose(mat3(x, cross(n, x), n));
    return lf_evaluate(surface * l, surface * v@THERE@);
}
//@ else
// BRDF [1/sr] in any frame: an isotropic surface asks for no tangent.
vec3 lf_brdf(@FRAME@) {
    float NoL = dot(n, l);
    float NoV = dot(n, v);
    return lf_evaluate(FreeDirection(l - NoL * n, NoL), FreeDirection(v - NoV * n, NoV)@THERE@);
}
//@ end
