// BRDF [1/sr] in any frame: an isotropic surface asks for cosines, and how far the two directions lean apart.
vec3 lf_brdf(@FRAME@) {
    float NoL = dot(n, l);
    float NoV = dot(n, v);
    vec3 lean = l + v - (NoL + NoV) * n;
    return lf_shade(NoL, NoV, dot(lean, lean));
}
