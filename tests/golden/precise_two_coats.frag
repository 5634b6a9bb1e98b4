#version 330 core
// precise, two coats: Coat over Coat over Conductor.
// Printed by layerfit 0.1.0 from its precise form.
// Left out, because this material does without: coat: anisotropy, primer: anisotropy, base: anisotropy.
// Indices of refraction are relative to the layer above: its own index divides those in the preset.
//
// vec3 lf_brdf(vec3 n, vec3 v, vec3 l) is the BRDF [1/sr] of unit directions that point away from the surface: v to the viewer, l to
// the light. It holds no cosine and no light, is one-sided (0 below the surface), and is linear Rec.709.
// Define LF_LIBRARY to take the functions without the entry point below.

struct Coat {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    float eta;    // index of refraction, against air
    vec3 tau;     // optical depth, one way at normal incidence
};

struct Interface {
    float tilt;        // turn of the mean facet towards a grazing direction
    float gain;        // part of the reflected light that a second facet lets in
    vec4 passed;       // energy that passes, beyond the closed form: four coefficients
    vec2 passed_high;  // the other two, of higher powers
    vec4 bend;         // part by which the sine of light becomes smaller below
    vec2 bend_high;    // 
    vec4 spread;       // width of a lobe seen through it, over that of the facets
    vec2 spread_high;  // 
    vec4 path;         // mean path over that of the refracted direction
    vec2 path_high;    // 
    vec4 theta;        // scale of the path's distribution
    vec2 theta_high;   // 
};

struct Curve {
    vec3 c0;  // coefficients of the powers of the curves' argument
    vec3 c1;  // 
    vec3 c2;  // 
    vec3 c3;  // 
    vec3 c4;  // 
    vec3 c5;  // 
};

struct Conductor {
    float alpha;  // width of the facet slopes; the square of an artist's roughness
    vec3 eta;     // index of refraction, real part
    vec3 k;       // index of refraction, imaginary part
};

struct Crossing {
    vec4 w;       // median direction
    float T;      // energy that passes
    float a;      // spread, as a width
    float path;   // mean path, in thicknesses
    float theta;  // scale of the path's distribution
    float s;      // argument of the baked curves
};

struct Shares {
    float base;  // due to the base
    float i;     // due to one crossing
    float o;     // due to the other
};

const Coat lf_coat = Coat(
    0.1,                   // alpha: width of the facet slopes; the square of an artist's roughness
    1.5,                   // eta: index of refraction, against air
    vec3(0.05, 0.2, 0.6)   // tau: optical depth, one way at normal incidence
);

const Coat lf_primer = Coat(
    0.25,                 // alpha: width of the facet slopes; the square of an artist's roughness
    1.1999999,            // eta: index of refraction, against air
    vec3(0.3, 0.1, 0.2)   // tau: optical depth, one way at normal incidence
);

const Interface lf_coat_top = Interface(
    0.024779005,                                                  // tilt: turn of the mean facet towards a grazing direction
    0.036722906,                                                  // gain: part of the reflected light that a second facet lets in
    vec4(-0.035054997, 0.020641431, 0.025624495, -0.0064411927),  // passed: energy that passes, beyond the closed form: four coefficients
    vec2(-0.0061165085, -0.00076546334),                          // passed_high: the other two, of higher powers
    vec4(0.29210538, 0.0642801, -0.031056285, 0.0017112494),      // bend: part by which the sine of light becomes smaller below
    vec2(0.0066233575, -0.0037422478),                            // bend_high: 
    vec4(0.7778974, -0.42731008, 0.14473301, 0.0003119707),       // spread: width of a lobe seen through it, over that of the facets
    vec2(-0.11521681, -0.009224892),                              // spread_high: 
    vec4(1.1060052, -0.18565032, 0.08457264, 0.017342567),        // path: mean path over that of the refracted direction
    vec2(-0.025979936, 0.0063171387),                             // path_high: 
    vec4(0.26631966, -0.53991795, 0.37586775, -0.10775492),       // theta: scale of the path's distribution
    vec2(-0.07368938, 0.10674948)                                 // theta_high: 
);

const Interface lf_coat_both = Interface(
    0.024779005,                                                  // tilt: turn of the mean facet towards a grazing direction
    0.036722906,                                                  // gain: part of the reflected light that a second facet lets in
    vec4(-0.035054997, 0.020641431, 0.025624495, -0.0064411927),  // passed: energy that passes, beyond the closed form: four coefficients
    vec2(-0.0061165085, -0.00076546334),                          // passed_high: the other two, of higher powers
    vec4(0.39746922, 0.057255983, -0.027260408, 0.002767682),     // bend: part by which the sine of light becomes smaller below
    vec2(0.0068576634, -0.00264287),                              // bend_high: 
    vec4(0.09954319, -0.03336258, 0.012172839, -0.000896357),     // spread: width of a lobe seen through it, over that of the facets
    vec2(-0.011329744, -0.0025816858),                            // spread_high: 
    vec4(1.0546787, -0.07149202, 0.017656773, 0.017326474),       // path: mean path over that of the refracted direction
    vec2(-0.010948896, -0.0020992756),                            // path_high: 
    vec4(0.08373746, -0.15304106, 0.07681082, 0.021044184),       // theta: scale of the path's distribution
    vec2(-0.030428441, 0.0178402)                                 // theta_high: 
);

const Curve lf_coat_passed = Curve(
    vec3(0.98885643, 0.9825332, 0.9749934),           // c0: coefficients of the powers of the curves' argument
    vec3(-0.0048447847, 0.0019959211, 0.008327633),   // c1: 
    vec3(-0.008213818, -0.008019477, -0.0050720274),  // c2: 
    vec3(-0.003549695, -0.0004518032, 0.0027161837),  // c3: 
    vec3(0.008597374, 0.0072605014, 0.005341053),     // c4: 
    vec3(0.008965015, 0.006336689, 0.0031301975)      // c5: 
);

const Curve lf_coat_inner_again = Curve(
    vec3(0.68565, 0.4859706, 0.24335311),           // c0: coefficients of the powers of the curves' argument
    vec3(-0.17177114, -0.08744605, -0.031251997),   // c1: 
    vec3(0.007447973, 0.028321177, 0.018363692),    // c2: 
    vec3(-0.005469978, 0.01605329, 0.03381288),     // c3: 
    vec3(-0.105131224, -0.09610081, -0.052035764),  // c4: 
    vec3(-0.08790657, -0.09205216, -0.062161952)    // c5: 
);

const Curve lf_coat_inner_rest = Curve(
    vec3(0.09114473, 0.074156426, 0.048794918),         // c0: coefficients of the powers of the curves' argument
    vec3(-0.017879615, -0.012615352, -0.0066391244),    // c1: 
    vec3(-0.00023009628, 0.0017982423, 0.0009799618),   // c2: 
    vec3(-0.012969289, -0.006727636, -0.0021987557),    // c3: 
    vec3(-0.0117995925, -0.01217526, -0.008717734),     // c4: 
    vec3(-0.0020358562, -0.0063103773, -0.0059840716)   // c5: 
);

const Conductor lf_base = Conductor(
    0.25,                                     // alpha: width of the facet slopes; the square of an artist's roughness
    vec3(0.11166667, 0.5133334, 0.61222225),  // eta: index of refraction, real part
    vec3(2.173889, 1.3627778, 1.19)           // k: index of refraction, imaginary part
);

const Curve lf_coat_again = Curve(
    vec3(0.3433084, 0.44900802, 0.3121879),          // c0: coefficients of the powers of the curves' argument
    vec3(-0.007885136, -0.019462474, -0.026199639),  // c1: 
    vec3(0.025252238, 0.026830286, 0.019494131),     // c2: 
    vec3(0.008871883, -0.005285442, 0.01586482),     // c3: 
    vec3(-0.052790955, -0.065843314, -0.054506034),  // c4: 
    vec3(-0.03575173, -0.036551833, -0.049341172)    // c5: 
);

const Curve lf_coat_rest = Curve(
    vec3(0.47580677, 0.37167528, 0.24029642),        // c0: coefficients of the powers of the curves' argument
    vec3(-0.013003267, -0.016849011, -0.022144146),  // c1: 
    vec3(0.04136759, 0.015886098, 0.0069574267),     // c2: 
    vec3(0.032524765, -0.0036182702, 0.009152859),   // c3: 
    vec3(-0.072990045, -0.038214356, -0.02734989),   // c4: 
    vec3(-0.0659883, -0.0233365, -0.028268576)       // c5: 
);

// The cosine between either direction and their half vector.
float lf_half_cosine(vec4 wi, vec4 wo) {
    vec4 s = wi + wo;
    float s2 = max(dot(s, s), 1e-20);
    return min(0.5 * sqrt(s2), 1.0);
}

// Exact reflectance of a dielectric boundary (Born and Wolf 1999, 1.5.2); 1 under total internal reflection.
float lf_fresnel_dielectric(float c, float eta) {
    float delta = (eta - 1.0) * (eta + 1.0);
    float g2 = delta + c * c;
    float g = sqrt(g2);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float rs = delta * (perpendicular * perpendicular);
    float rp = delta * ((eta2 + 1.0) * (c * c) - 1.0) * (parallel * parallel);
    float reflectance = 0.5 * (rs * rs + rp * rp);
    return reflectance;
}

// The unit vector halfway between two directions on the same side of the surface.
vec4 lf_half_vector(vec4 wi, vec4 wo) {
    vec4 s = wi + wo;
    return s * inversesqrt(max(dot(s, s), 1e-20));
}

// GGX density of facet normals (Walter et al. 2007, eq. 33).
float lf_ggx_d(vec4 h, float alpha) {
    float root = alpha / (dot(h.xyz, h.xyz) + alpha * alpha * (h.w * h.w));
    return root * root * 0.31830987;
}

// NoW (1 + 2 Lambda) of the GGX distribution (Heitz 2014, eq. 72, multiplied out).
float lf_ggx_projection(vec4 w, float alpha) {
    float a2 = alpha * alpha;
    return sqrt(a2 + (1.0 - a2) * (w.w * w.w));
}

// G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99).
float lf_v_smith(float NoL, float NoV, float projection_l, float projection_v) {
    return 0.5 / max(NoV * projection_l + NoL * projection_v, 1e-14);
}

// Argument of the baked curves: 1 / (NoW + .2) from the first node of the tables to 1, as -1 to 1.
float lf_grazing(float NoW) {
    return max(1.4645134 - 0.55741614 / (NoW + 0.2), -1.0);
}

// Cosine between a direction and the facets that it meets.
float lf_facet_cosine(vec4 w, float tilt) {
    return sqrt(tilt + (1.0 - tilt) * (w.w * w.w));
}

// 1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection.
float lf_transmittance_dielectric(float c, float eta) {
    float g = sqrt((eta - 1.0) * (eta + 1.0) + c * c);
    float eta2 = eta * eta;
    float perpendicular = 1.0 / (c + g);
    float parallel = 1.0 / (eta2 * c + g);
    float passed = 2.0 * (c * g) * (perpendicular * perpendicular + eta2 * (parallel * parallel));
    return passed;
}

// Energy that passes a rough interface, from what passes the mean facet; `gain` is `second_facet`.
float lf_with_second_facet(float T, float gain) {
    return T + (1.0 - T) * gain;
}

// A polynomial of six coefficients at s.
float lf_curve(vec4 low, vec2 high, float s) {
    return low.x + s * (low.y + s * (low.z + s * (low.w + s * (high.x + s * high.y))));
}

// Follow one direction through the coat's rough top.
Crossing lf_pass_interface(Interface interface_, float eta, float alpha, vec4 w) {
    float s = lf_grazing(w.w);
    float T = lf_with_second_facet(lf_transmittance_dielectric(lf_facet_cosine(w, interface_.tilt), eta), interface_.gain);
    T = max(T + lf_curve(interface_.passed, interface_.passed_high, s), 0.0);
    T = min(T, 1.0);
    float bend = lf_curve(interface_.bend, interface_.bend_high, s);
    float z = sqrt(w.w * w.w + bend * (2.0 - bend) * dot(w.xyz, w.xyz));
    float a = lf_curve(interface_.spread, interface_.spread_high, s) * alpha;
    float path = max(lf_curve(interface_.path, interface_.path_high, s), 1.0) / z;
    float theta = max(lf_curve(interface_.theta, interface_.theta_high, s), 0.0);
    return Crossing(vec4(w.xyz * (1.0 - bend), z), T, a, path, theta, s);
}

// 0 where the indices match and there is no interface, 1 from 1.15 on.
float lf_presence(float eta) {
    return 2.0 - 1.0;
}

// The polynomial at s; an energy is never below 0.
vec3 lf_amount(Curve curve, float s) {
    return curve.c0 + s * (curve.c1 + s * (curve.c2 + s * (curve.c3 + s * (curve.c4 + s * curve.c5))));
}

// What the width of a lobe is due to.
Shares lf_split(Crossing i, Crossing o, float alpha) {
    float base = pow(max(alpha * (i.w.w + o.w.w), 1e-30), 1.41);
    float first = pow(i.a, 1.41);
    float second = pow(o.a, 1.41);
    float inverse = 1.0 / (base + first + second);
    return Shares(base * inverse, first * inverse, second * inverse);
}

// The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone.
vec4 lf_lean(Crossing x, Crossing i, Crossing o, float share) {
    vec3 turn = 1.099 * share * (i.w.xyz + o.w.xyz);
    float z2 = x.w.w * x.w.w;
    z2 = max(z2 + dot(turn, 2.0 * x.w.xyz - turn), min(z2, 0.0004));
    return vec4(x.w.xyz - turn, sqrt(z2));
}

// A direction below a smooth boundary, as it is above it; `eta` is the index below over that above.
vec4 lf_upwards(vec4 w, float eta) {
    vec3 part = eta * w.xyz;
    float sine = sqrt(dot(part, part));
    float held = min(1.0, 0.9998 / max(sine, 1e-06));
    sine = min(sine, 0.9998);
    return vec4(part * held, sqrt((1.0 - sine) * (1.0 + sine)));
}

// Mean path of light that the base sends on: between that of one direction and that of all that cross.
float lf_between(vec4 y, Crossing x, float part) {
    float straight = 1.0 / y.w;
    return straight + part * (x.path - straight);
}

// How the spread of paths shows at depth tau, 1 where all are alike: of an inverse Gaussian (Tweedie 1957).
vec3 lf_spread_root(float theta, vec3 tau) {
    return sqrt(1.0 + 2.0 * theta * tau);
}

// Density of a lobe about the refracted directions, of a base of width alpha seen through the interface twice; M is the sum of the cosines.
float lf_lobe(Crossing i, Crossing o, float M, float alpha) {
    float base = alpha * M;
    float width2 = pow(pow(max(base, 1e-30), 1.41) + (pow(i.a, 1.41) + pow(o.a, 1.41)), 1.4184397);
    float x = 0.2559 * (width2 / (base * base + 0.3109 * (i.a * i.a + o.a * o.a)) - 1.0);
    vec3 t = i.w.xyz + o.w.xyz;
    float v = dot(t, t) / width2;
    return 1.0 / (3.1415927 * width2 * (1.0 + v * (2.0 - x * (1.986 - x * (0.668 - 0.1745 * x)) + (1.0 + x) * v)));
}

// Width of the lobe of light that met a base of width alpha twice, and the coat in between.
float lf_wider(float alpha, float coat_alpha) {
    return pow(pow(alpha, 1.41) + pow(alpha, 1.41) + pow(0.9226 * coat_alpha, 1.41), 0.7092199);
}

// What is left of the direction in light that went to and fro, over pi: more goes on than back, the smoother the base.
float lf_ahead(Crossing i, Crossing o, float eta, float alpha) {
    float back = eta * eta * dot(i.w.xyz, o.w.xyz);
    return max(1.0 - (1.0 - alpha) * back, 0.0) / 3.1415927;
}

// Part of a density of facets that is seen and hides nothing, without the projected areas; h2 is the square of the sum of both directions.
float lf_seen(vec4 yi, vec4 yo, float h2, float width) {
    float M = yi.w + yo.w;
    float slope = h2 / M;
    float projection_i = lf_ggx_projection(yi, width);
    float projection_o = lf_ggx_projection(yo, width);
    return slope * slope * (yi.w * yo.w) * lf_v_smith(yi.w, yo.w, projection_i, projection_o);
}

// Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2).
vec3 lf_fresnel_conductor(float c, vec3 eta, vec3 k) {
    float c2 = c * c;
    float s2 = 1.0 - c2;
    vec3 p = (eta - k) * (eta + k) - s2;
    vec3 nk = eta * k;
    vec3 q = sqrt(p * p + 4.0 * nk * nk);
    vec3 larger = sqrt(0.5 * (q + (-p)));
    vec3 a = nk / larger;
    vec3 twice_ac = 2.0 * a * c;
    vec3 even = q * c2 + s2 * s2;
    vec3 odd = twice_ac * s2;
    return (q + c2 - twice_ac) * even / max((q + c2 + twice_ac) * (even + odd), 1e-12);
}

// BRDF [1/sr] of unit directions, each its part along the surface and its cosine; without the cosine.
vec3 lf_evaluate(vec4 wi, vec4 wo) {
    bool lit = min(wi.w, wo.w) > 0.0;
    float F = lf_fresnel_dielectric(lf_half_cosine(wi, wo), lf_coat.eta);
    float D = lf_ggx_d(lf_half_vector(wi, wo), lf_coat.alpha);
    float projection_i = lf_ggx_projection(wi, lf_coat.alpha);
    float projection_o = lf_ggx_projection(wo, lf_coat.alpha);
    float V = lf_v_smith(wi.w, wo.w, projection_i, projection_o);
    Crossing crossing = lf_pass_interface(lf_coat_top, lf_coat.eta, lf_coat.alpha, wi);
    Crossing crossing2 = lf_pass_interface(lf_coat_top, lf_coat.eta, lf_coat.alpha, wo);
    Crossing crossing3 = lf_pass_interface(lf_coat_both, lf_coat.eta, 1.0, wi);
    Crossing crossing4 = lf_pass_interface(lf_coat_both, lf_coat.eta, 1.0, wo);
    float there = lf_presence(lf_primer.eta);
    float alpha = lf_coat.alpha + there * (lf_primer.alpha - lf_coat.alpha);
    float eta = lf_coat.eta * lf_primer.eta;
    vec3 kept = lf_amount(lf_coat_passed, crossing3.s) * lf_amount(lf_coat_passed, crossing4.s);
    Shares shares = lf_split(crossing3, crossing4, lf_base.alpha);
    float part = 0.2675 + 0.5116 * shares.base * shares.base;
    vec4 y = lf_upwards(lf_lean(crossing3, crossing3, crossing4, shares.i), lf_primer.eta);
    vec3 left = lf_coat.tau + (lf_between(y, crossing, part) - 1.0) * (2.0 * lf_coat.tau / (1.0 + lf_spread_root(part * crossing.theta, lf_coat.tau)));
    y = lf_upwards(lf_lean(crossing4, crossing3, crossing4, shares.o), lf_primer.eta);
    left = left + (lf_coat.tau + (lf_between(y, crossing2, part) - 1.0) * (2.0 * lf_coat.tau / (1.0 + lf_spread_root(part * crossing2.theta, lf_coat.tau))));
    kept = kept * exp(-left);
    float throughput = crossing.T * crossing2.T / (lf_coat.eta * lf_coat.eta);
    shares = lf_split(crossing, crossing2, lf_primer.alpha);
    part = 0.2675 + 0.5116 * shares.base * shares.base;
    vec4 yi = lf_lean(crossing, crossing, crossing2, shares.i);
    vec4 yo = lf_lean(crossing2, crossing, crossing2, shares.o);
    float path_i = lf_between(yi, crossing, part);
    float path_o = lf_between(yo, crossing2, part);
    vec3 root_i = lf_spread_root(part * crossing.theta, lf_coat.tau);
    vec3 root_o = lf_spread_root(part * crossing2.theta, lf_coat.tau);
    vec3 U = (1.0 + (path_i - 1.0) / root_i) * (1.0 + (path_o - 1.0) / root_o);
    vec3 throughput2 = throughput * exp(-(lf_coat.tau + (path_i - 1.0) * (2.0 * lf_coat.tau / (1.0 + root_i)) + (lf_coat.tau + (path_o - 1.0) * (2.0 * lf_coat.tau / (1.0 + root_o)))));
    vec4 h = yi + yo;
    float h2 = dot(h, h);
    float F2 = lf_fresnel_dielectric(min(0.5 * sqrt(h2), 1.0), lf_primer.eta);
    float rise = 1.0 + 0.468 * lf_presence(lf_coat.eta) * lf_coat.alpha * lf_coat.alpha * shares.base;
    vec3 again = F2 * (lf_amount(lf_coat_inner_again, crossing.s) * lf_amount(lf_coat_inner_again, crossing2.s));
    vec3 lobes = rise * lf_lobe(crossing, crossing2, h.w, lf_primer.alpha) + again * lf_lobe(crossing, crossing2, h.w, lf_wider(lf_primer.alpha, lf_coat.alpha));
    vec3 root = lf_amount(lf_coat_inner_rest, crossing.s) * lf_amount(lf_coat_inner_rest, crossing2.s);
    vec3 rest = root * root * lf_ahead(crossing, crossing2, lf_coat.eta, lf_primer.alpha);
    throughput = crossing3.T * crossing4.T / (eta * eta);
    shares = lf_split(crossing3, crossing4, lf_base.alpha);
    part = 0.2675 + 0.5116 * shares.base * shares.base;
    vec4 yi2 = lf_lean(crossing3, crossing3, crossing4, shares.i);
    vec4 yo2 = lf_lean(crossing4, crossing3, crossing4, shares.o);
    path_i = lf_between(yi2, crossing3, part);
    path_o = lf_between(yo2, crossing4, part);
    root_i = lf_spread_root(part * crossing3.theta, lf_primer.tau);
    root_o = lf_spread_root(part * crossing4.theta, lf_primer.tau);
    vec3 U2 = (1.0 + (path_i - 1.0) / root_i) * (1.0 + (path_o - 1.0) / root_o);
    vec3 throughput3 = throughput * exp(-(lf_primer.tau + (path_i - 1.0) * (2.0 * lf_primer.tau / (1.0 + root_i)) + (lf_primer.tau + (path_o - 1.0) * (2.0 * lf_primer.tau / (1.0 + root_o)))));
    h = yi2 + yo2;
    float h22 = dot(h, h);
    vec3 F3 = lf_fresnel_conductor(min(0.5 * sqrt(h22), 1.0), lf_base.eta, lf_base.k);
    rise = 1.0 + 0.468 * lf_presence(eta) * alpha * alpha * shares.base;
    again = F3 * (lf_amount(lf_coat_again, crossing3.s) * lf_amount(lf_coat_again, crossing4.s));
    vec3 lobes2 = rise * lf_lobe(crossing3, crossing4, h.w, lf_base.alpha) + again * lf_lobe(crossing3, crossing4, h.w, lf_wider(lf_base.alpha, alpha));
    root = lf_amount(lf_coat_rest, crossing3.s) * lf_amount(lf_coat_rest, crossing4.s);
    vec3 rest2 = root * root * lf_ahead(crossing3, crossing4, eta, lf_base.alpha);
    vec3 value = F * D * V + (throughput2 * (F2 * U * (lf_seen(yi, yo, h2, lf_primer.alpha) * lobes) + rest) + kept * (throughput3 * (F3 * U2 * (lf_seen(yi2, yo2, h22, lf_base.alpha) * lobes2) + rest2)));
    return lit ? value : vec3(0.0);
}

// BRDF [1/sr] in any frame: an isotropic surface asks for no tangent.
vec3 lf_brdf(vec3 n, vec3 v, vec3 l) {
    float NoL = dot(n, l);
    float NoV = dot(n, v);
    return lf_evaluate(vec4(l - NoL * n, NoL), vec4(v - NoV * n, NoV));
}

#ifndef LF_LIBRARY

#ifndef LF_LIGHTS
#define LF_LIGHTS 1
#endif

in vec3 v_position;  // this, u_eye and u_light in one space, such as the world's
in vec3 v_normal;
out vec4 color;

uniform vec3 u_eye;
uniform vec4 u_light[LF_LIGHTS];      // w = 0: direction to a distant light; w = 1: position of a point light
uniform vec3 u_light_rgb[LF_LIGHTS];  // its irradiance; its intensity per steradian

// Unit direction l to a light and the irradiance on a surface that faces it.
vec3 lf_light(vec4 light, vec3 rgb, vec3 position, out vec3 l) {
    vec3 away = light.xyz - position * light.w;
    float distance2 = dot(away, away);
    l = away * inversesqrt(distance2);
    return rgb / (light.w > 0.0 ? distance2 : 1.0);
}

// Linear radiance, or sRGB (IEC 61966-2-1) for a screen when LF_SRGB is defined.
vec3 lf_output(vec3 radiance) {
#ifdef LF_SRGB
    vec3 x = clamp(radiance, 0.0, 1.0);
    return mix(12.92 * x, 1.055 * pow(max(x, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055, greaterThan(x, vec3(0.0031308)));
#else
    return radiance;
#endif
}

void main() {
    vec3 n = normalize(v_normal);
    vec3 v = normalize(u_eye - v_position);
    vec3 radiance = vec3(0.0);
    for (int k = 0; k < LF_LIGHTS; ++k) {
        vec3 l;
        vec3 irradiance = lf_light(u_light[k], u_light_rgb[k], v_position, l);
        radiance += lf_brdf(n, v, l) * irradiance * max(dot(n, l), 0.0);
    }
    color = vec4(lf_output(radiance), 1.0);
}

#endif
