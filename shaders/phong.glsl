// The measure of cost: diffuse and a glossy lobe after Phong 1975, eight lines of arithmetic that every GPU knows.
vec3 lf_brdf(@FRAME@) {
    vec3 r = 2.0 * dot(n, l) * n - l;
    return vec3(0.16, 0.09, 0.04) + 0.3 * pow(max(dot(r, v), 0.0), 80.0);
}
