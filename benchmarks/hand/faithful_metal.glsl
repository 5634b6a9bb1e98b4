// lacquered copper in the faithful form, written by hand in cosines: the fewest operations that keep every digit.
const float ETA = 1.5, ALPHA = 0.1, BASE_ALPHA = 0.2;
const vec3 TAU = vec3(0.05, 0.2, 0.6);
const vec3 N = vec3(0.201, 0.924, 1.102) / ETA, K = vec3(3.913, 2.453, 2.142) / ETA;

const float PI = 3.1415927, ETA2 = ETA * ETA, DELTA = (ETA - 1.0) * (ETA + 1.0);
const float A2 = ALPHA * ALPHA, B2 = BASE_ALPHA * BASE_ALPHA;
const vec3 P0 = (N - K) * (N + K), NK = N * K, NK4 = 4.0 * NK * NK;

vec3 lf_shade(float NoL, float NoV, float lean2) {
    float M = NoL + NoV;
    float M2 = M * M;
    float s2 = lean2 + M2;
    float c2 = 0.25 * s2;
    float c = sqrt(c2);
    float g2 = DELTA + c2;
    float g = sqrt(g2);
    float across = (c + g) * (c + g);
    float along = (ETA2 * c + g) * (ETA2 * c + g);
    float rp = ((ETA2 + 1.0) * c2 - 1.0) * across;
    float product = across * along;
    float F = (along * along + rp * rp) * (0.5 * DELTA * DELTA) / (product * product);
    float narrow = s2 / (lean2 + A2 * M2);
    float hidden_l = sqrt(A2 + (1.0 - A2) * (NoL * NoL));
    float hidden_v = sqrt(A2 + (1.0 - A2) * (NoV * NoV));
    float FV = F * 0.5 / (NoV * hidden_l + NoL * hidden_v);
    float top = FV * (A2 / PI) * (narrow * narrow);
    float turn = (g - c) * (0.5 / ETA) * M / c;
    float z_l = NoL * (1.0 / ETA) + turn;
    float z_v = NoV * (1.0 / ETA) + turn;
    float p_l = sqrt(B2 + (1.0 - B2) * (z_l * z_l));
    float p_v = sqrt(B2 + (1.0 - B2) * (z_v * z_v));
    float wide = s2 / (lean2 + B2 * M2);
    float left = (1.0 - F) * (1.0 - FV * 4.0 * NoL * NoV);
    float lobe = left * (B2 * 0.5 / PI) * (wide * wide) / (z_v * p_l + z_l * p_v);
    // A metal whose k is above its n: p is below 0.
    float b2 = g2 * (1.0 / ETA2);
    float sin2 = 1.0 - b2;
    vec3 p = P0 - sin2;
    vec3 q = sqrt(p * p + NK4);
    vec3 ac = NK * (2.0 / ETA * g) / sqrt(0.5 * (q - p));
    vec3 sum = q + b2;
    vec3 even = q * b2 + sin2 * sin2;
    vec3 metal = (sum - ac) * even / ((sum + ac) * (even + ac * sin2));
    vec3 f = top + metal * (lobe * exp(-TAU * ((z_l + z_v) / (z_l * z_v))));
    f = min(z_l, z_v) > 0.0 ? f : vec3(top);
    return min(NoL, NoV) > 0.0 ? f : vec3(0.0);
}
