// Copper, bare, written by hand in cosines: Cook-Torrance with GGX facets and the exact reflectance of a metal.
const float ALPHA = 0.2;
const vec3 N = vec3(0.201, 0.924, 1.102), K = vec3(3.913, 2.453, 2.142);

const float PI = 3.1415927, A2 = ALPHA * ALPHA;
const vec3 P0 = (N - K) * (N + K), NK = N * K, NK4 = 4.0 * NK * NK;

vec3 lf_shade(float NoL, float NoV, float lean2) {
    float M = NoL + NoV;
    float M2 = M * M;
    float s2 = lean2 + M2;
    float narrow = s2 / (lean2 + A2 * M2);
    float hidden_l = sqrt(A2 + (1.0 - A2) * (NoL * NoL));
    float hidden_v = sqrt(A2 + (1.0 - A2) * (NoV * NoV));
    float DV = (A2 * 0.5 / PI) * (narrow * narrow) / (NoV * hidden_l + NoL * hidden_v);
    float c2 = 0.25 * s2;
    float sin2 = 1.0 - c2;
    vec3 p = P0 - sin2;
    vec3 q = sqrt(p * p + NK4);
    vec3 ac = NK * sqrt(s2) / sqrt(0.5 * (q - p));
    vec3 sum = q + c2;
    vec3 even = q * c2 + sin2 * sin2;
    vec3 F = (sum - ac) * even / ((sum + ac) * (even + ac * sin2));
    return min(NoL, NoV) > 0.0 ? F * DV : vec3(0.0);
}
