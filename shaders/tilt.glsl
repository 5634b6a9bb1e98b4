//@ if tangent
// The normal along (slopes, 1) in the frame of n and t.
vec3 lf_tilted(vec3 n, vec3 t, vec2 slopes) {
    vec3 x = normalize(t - dot(t, n) * n);
    return normalize(slopes.x * x + slopes.y * cross(n, x) + n);
}
//@ else
// The normal along (slopes, 1) in a frame of n alone (Duff et al. 2017).
vec3 lf_tilted(vec3 n, vec2 slopes) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    vec3 x = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    return normalize(slopes.x * x + slopes.y * cross(n, x) + n);
}
//@ end
