// The mean of passes as a screen shows it, over what they cover; outside of it what is behind shows through.
uniform highp sampler2D u_total;
uniform float u_passes;
uniform float u_exposure;
uniform int u_tone;
out vec4 color;
vec3 neutral(vec3 c) {  // Khronos PBR Neutral tone mapper (2024): colours stay as they are up to 0.8
    float x = min(c.r, min(c.g, c.b));
    c -= x < 0.08 ? x - 6.25 * x * x : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < 0.76) return c;
    float d = 1.0 - 0.76;
    float next = 1.0 - d * d / (peak + d - 0.76);
    return mix(c * next / peak, vec3(next), 1.0 - 1.0 / (0.15 * (peak - next) + 1.0));
}
vec3 filmic(vec3 c) {  // fit to the ACES curve (Narkowicz 2015)
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
}
void main() {
    vec4 total = texelFetch(u_total, ivec2(gl_FragCoord.xy), 0);
    vec3 c = max(u_exposure * total.rgb / max(total.a, 1e-6), 0.0);
    c = clamp(u_tone == 1 ? neutral(c) : u_tone == 2 ? filmic(c) : c, 0.0, 1.0);
    c = mix(12.92 * c, 1.055 * pow(max(c, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
    float a = total.a / u_passes;
    color = vec4(c * a, a);
}
