// carpaint.glsl: shades a paint from its texture bundle. GLSL ES 3.00, no #version line, no main().
//
// All directions are unit vectors in the frame whose z axis is the surface normal: wi to the light, wo to the viewer.
// All values are BRDF values in 1/sr, linear sRGB; multiply by the cosine wi.z and by the light's irradiance.
//
//   carpaint_evaluate(wi, wo)            flakes at their mean: the far view
//   carpaint_shade(wi, wo, texel)        flakes of one texel of the paint: the close view
//   carpaint_shade_area(wi, wo, p, dx, dy)  flakes of the texels under a pixel: every view between the two
//   carpaint_mirror(wo)                  weight of the coat's mirror image, for environments
//
// A texel of the paint is `texel_um` micrometres wide (material.json). Numbers are fetched, never filtered: upload every
// texture with nearest filtering, without mipmaps, without flipping, premultiplication or color conversion.
//
// For the bundle of a whole blend define CARPAINT_PAINTS as its number of paints (2 to 5) before this file: boxes and color
// table are then mixed by carpaint_weights, and carpaint_slice_means must hold the means of those weights.

precision highp float;
precision highp int;
precision highp sampler2D;

#define CARPAINT_MAX_LOBES 8

uniform sampler2D carpaint_angles;         // angle grids in degrees, one a row
uniform sampler2D carpaint_color_table;    // linear sRGB
uniform sampler2D carpaint_slice_means;    // 1/sr
uniform sampler2D carpaint_slices;         // first cluster, number of clusters
uniform sampler2D carpaint_corners_lower;  // Lab
uniform sampler2D carpaint_corners_upper;  // Lab
uniform sampler2D carpaint_cumulative;     // within the slice
uniform sampler2D carpaint_alias;          // threshold, alias
uniform sampler2D carpaint_random;         // RGBA8, a 32-bit number each

uniform vec3 carpaint_diffuse;                              // albedo before the color table
uniform int carpaint_lobes;                                 // how many of the following hold
uniform vec3 carpaint_lobe_weight[CARPAINT_MAX_LOBES];      // s
uniform vec2 carpaint_lobe_shape[CARPAINT_MAX_LOBES];       // alpha, F0
uniform vec2 carpaint_coat;                                 // ior (1 without a coat), roughness
uniform ivec4 carpaint_grid;                                // angles: color table h, d, flakes h, d (0 without flakes)
uniform vec2 carpaint_persistence_deg;                      // along theta_h and theta_d
uniform vec3 carpaint_corner_scale;                         // 1 unless corners are 8-bit
uniform vec3 carpaint_corner_offset;                        // 0 unless corners are 8-bit
#ifdef CARPAINT_PAINTS
uniform vec3 carpaint_weights[CARPAINT_PAINTS]; // of base, of the flakes' lightness, of their color (times saturation)
#endif

const float CARPAINT_PI = 3.14159265358979;
const float CARPAINT_DEGREES = 57.2957795130823;

// ---- angles ----

// theta_h and theta_d in degrees, the cosines h.n and h.o, and tan^2 theta_h.
struct CarpaintHalf {
    float theta_h_deg;
    float theta_d_deg;
    float h_z;
    float h_o;
    float tan2_h;
};

CarpaintHalf carpaint_half(vec3 wi, vec3 wo) {
    vec3 sum = wi + wo;
    float cosine2 = length(sum);
    float sine2 = length(wi - wo);
    vec3 h = cosine2 > 0.0 ? sum / cosine2 : vec3(0.0, 0.0, 1.0);
    float across = length(h.xy);
    CarpaintHalf a;
    a.theta_h_deg = atan(across, h.z) * CARPAINT_DEGREES;
    a.theta_d_deg = atan(sine2, cosine2) * CARPAINT_DEGREES;
    a.h_z = h.z;
    a.h_o = cosine2 / max(length(vec2(sine2, cosine2)), 1e-20);
    a.tan2_h = across * across / (h.z * h.z);
    return a;
}

// Neighbours of an angle in row `row` of carpaint_angles, and the weight of the second.
struct CarpaintBracket {
    int low;
    int high;
    float fraction;
};

CarpaintBracket carpaint_bracket(int row, int count, float angle_deg) {
    int above = 0;
    int end = count;
    while (above < end) {
        int middle = (above + end) / 2;
        if (texelFetch(carpaint_angles, ivec2(middle, row), 0).r <= angle_deg) {
            above = middle + 1;
        } else {
            end = middle;
        }
    }
    if (above == 0) return CarpaintBracket(0, 0, 0.0);
    if (above == count) return CarpaintBracket(count - 1, count - 1, 0.0);
    float low = texelFetch(carpaint_angles, ivec2(above - 1, row), 0).r;
    float high = texelFetch(carpaint_angles, ivec2(above, row), 0).r;
    return CarpaintBracket(above - 1, above, (angle_deg - low) / (high - low));
}

vec3 carpaint_bilinear(sampler2D table, CarpaintBracket row, CarpaintBracket column) {
    vec3 ll = texelFetch(table, ivec2(column.low, row.low), 0).rgb;
    vec3 lh = texelFetch(table, ivec2(column.high, row.low), 0).rgb;
    vec3 hl = texelFetch(table, ivec2(column.low, row.high), 0).rgb;
    vec3 hh = texelFetch(table, ivec2(column.high, row.high), 0).rgb;
    return mix(mix(ll, lh, column.fraction), mix(hl, hh, column.fraction), row.fraction);
}

// ---- coat ----

// Written without differences that cancel near an index of 1, which reflects nothing and bends nothing.
float carpaint_fresnel(float cosine, float ior) {
    float excess = max((ior - 1.0) * (ior + 1.0), 0.0);
    if (excess == 0.0) return 0.0;
    float c = clamp(cosine, 0.0, 1.0);
    float n2 = ior * ior;
    float q = sqrt(c * c + excess);
    float s = excess / ((c + q) * (c + q));
    float p = excess * ((n2 + 1.0) * c * c - 1.0) / ((n2 * c + q) * (n2 * c + q));
    return 0.5 * (s * s + p * p);
}

vec3 carpaint_refract(vec3 w, float ior) {
    float excess = max((ior - 1.0) * (ior + 1.0), 0.0);
    return vec3(w.xy, sqrt(w.z * w.z + excess)) / ior;
}

// min(1/(i_z o_z), 2 h_z / ((h.o) max(i_z, o_z))): masking over both cosines.
float carpaint_masking(CarpaintHalf h, float i_z, float o_z) {
    return min(1.0 / (i_z * o_z), 2.0 * h.h_z / (h.h_o * max(i_z, o_z)));
}

// Highlight of a coat of finite width, directions outside the coat. 0 for a mirror.
float carpaint_highlight(vec3 wi, vec3 wo) {
    float roughness = carpaint_coat.y;
    if (roughness < 1e-3) return 0.0;
    CarpaintHalf h = carpaint_half(wi, wo);
    float alpha2 = roughness * roughness;
    float log_d = -h.tan2_h / alpha2 - log(CARPAINT_PI * alpha2) - 4.0 * log(h.h_z);
    return exp(log_d) * carpaint_fresnel(h.h_o, carpaint_coat.x) / 4.0 * carpaint_masking(h, wi.z, wo.z);
}

// Weight of the coat's perfect mirror image seen from wo, dimensionless; 0 where the highlight has finite width.
float carpaint_mirror(vec3 wo) {
    return carpaint_coat.y < 1e-3 ? carpaint_fresnel(wo.z, carpaint_coat.x) : 0.0;
}

// ---- base ----

#ifdef CARPAINT_PAINTS
vec3 carpaint_lab_to_rgb(vec3 lab);

// Linear sRGB of the blended color table at a node: paints stand one below the other in CIELAB, where they are mixed.
vec3 carpaint_chi_node(int theta_h, int theta_d) {
    vec3 lab = vec3(0.0);
    for (int m = 0; m < CARPAINT_PAINTS; ++m) {
        ivec2 at = ivec2(theta_d, theta_h + m * carpaint_grid.x);
        lab += carpaint_weights[m].x * texelFetch(carpaint_color_table, at, 0).rgb;
    }
    return carpaint_lab_to_rgb(clamp(lab, -2000.0, 2000.0));
}
#endif

// The color table at an angle pair inside the coat.
vec3 carpaint_chi(CarpaintHalf h) {
    CarpaintBracket row = carpaint_bracket(0, carpaint_grid.x, h.theta_h_deg);
    CarpaintBracket column = carpaint_bracket(1, carpaint_grid.y, h.theta_d_deg);
#ifdef CARPAINT_PAINTS
    vec3 low = mix(carpaint_chi_node(row.low, column.low), carpaint_chi_node(row.low, column.high), column.fraction);
    vec3 high = mix(carpaint_chi_node(row.high, column.low), carpaint_chi_node(row.high, column.high), column.fraction);
    return mix(low, high, row.fraction);
#else
    return carpaint_bilinear(carpaint_color_table, row, column);
#endif
}

// Diffuse and lobes times the color table, for directions inside the coat.
vec3 carpaint_base(CarpaintHalf h, float i_z, float o_z) {
    vec3 sum = carpaint_diffuse / CARPAINT_PI;
    for (int k = 0; k < carpaint_lobes; ++k) {
        float alpha = max(carpaint_lobe_shape[k].x, 1e-4);
        float f0 = carpaint_lobe_shape[k].y;
        float x = 1.0 - h.h_o;
        float schlick = f0 + (1.0 - f0) * x * x * x * x * x;
        float log_d = -h.tan2_h / (alpha * alpha) - 2.0 * log(alpha) - 4.0 * log(h.h_z);
        sum += carpaint_lobe_weight[k] * (exp(log_d) * schlick / CARPAINT_PI * carpaint_masking(h, i_z, o_z));
    }
    return carpaint_chi(h) * sum;
}

// ---- flakes ----

// One step of a permuted congruential generator (O'Neill 2014, PCG-RXS-M-XS).
uint carpaint_mix(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// A number strictly between 0 and 1 from the upper 23 bits: all that a float holds beside the half.
float carpaint_unit(uint x) {
    return (float(x >> 9u) + 0.5) / 8388608.0;
}

int carpaint_floor_div(int a, int b) {
    return a >= 0 ? a / b : -((b - 1 - a) / b);
}

// Number of the cell under a texel anywhere on the paint. Every repetition of the tile deals its ranks (the upper half)
// and phases (the two bytes of the lower) from another beginning.
uint carpaint_cell(ivec2 texel) {
    ivec2 size = textureSize(carpaint_random, 0);
    ivec2 tile = ivec2(carpaint_floor_div(texel.x, size.x), carpaint_floor_div(texel.y, size.y));
    uvec4 bytes = uvec4(texelFetch(carpaint_random, texel - tile * size, 0) * 255.0 + 0.5);
    uint cell = bytes.r | (bytes.g << 8u) | (bytes.b << 16u) | (bytes.a << 24u);
    if (tile == ivec2(0)) return cell;
    uint turn = carpaint_mix(uint(tile.x) + carpaint_mix(uint(tile.y)));
    uint rank = (cell & 0xffff0000u) + (turn & 0xffff0000u);
    uint phase_d = ((cell & 0xff00u) + (turn & 0xff00u)) & 0xff00u;
    return rank | phase_d | ((cell + turn) & 0xffu);
}

uint carpaint_epoch(float theta_deg, float persistence_deg, float phase) {
    return uint(max(theta_deg / max(persistence_deg, 0.01) + phase, 0.0));
}

// The four random numbers of a cell at an angle pair: x picks the cluster, yzw place the color in its box.
vec4 carpaint_draw(uint cell, float theta_h_deg, float theta_d_deg) {
    uint h = carpaint_epoch(theta_h_deg, carpaint_persistence_deg.x, (float(cell & 255u) + 0.5) / 256.0);
    uint d = carpaint_epoch(theta_d_deg, carpaint_persistence_deg.y, (float((cell >> 8u) & 255u) + 0.5) / 256.0);
    uint key = carpaint_mix(cell ^ carpaint_mix(h ^ carpaint_mix(d ^ 0xc2b2ae35u)));
    // Small odd factors: ranks that cover 0..1 evenly do so in every epoch.
    const uint factors[4] = uint[4](1u, 5u, 7u, 11u);
    uint factor = factors[(h + 2u * d) & 3u];
    return vec4(
        carpaint_unit((cell & 0xffff0000u) * factor + (h + d) * 0x361962eau + (key >> 16u)),
        carpaint_unit(carpaint_mix(key ^ 0x2545f491u)),
        carpaint_unit(carpaint_mix(key ^ 0x51ed270bu)),
        carpaint_unit(carpaint_mix(key ^ 0x7feb352du))
    );
}

ivec2 carpaint_at(int cluster, int width) {
    return ivec2(cluster % width, cluster / width);
}

// Cluster at a cumulative probability, by bisection: the draw of our previews.
int carpaint_pick(int first, int count, float pick) {
    int width = textureSize(carpaint_cumulative, 0).x;
    int low = 0;
    int end = count;
    while (low < end) {
        int middle = (low + end) / 2;
        if (texelFetch(carpaint_cumulative, carpaint_at(first + middle, width), 0).r <= pick) {
            low = middle + 1;
        } else {
            end = middle;
        }
    }
    return first + min(low, count - 1);
}

// The same from the alias table: two fetches however many clusters, the same histogram, but flakes of neighbouring
// slices do not belong together, so they flicker where those of carpaint_pick fade.
int carpaint_pick_alias(int first, int count, float pick) {
    int width = textureSize(carpaint_alias, 0).x;
    float place = pick * float(count);
    int slot = min(int(place), count - 1);
    vec2 entry = texelFetch(carpaint_alias, carpaint_at(first + slot, width), 0).rg;
    return first + (place - float(slot) < entry.x ? slot : int(entry.y + 0.5));
}

float carpaint_expand(float f) {
    const float knee = 6.0 / 29.0;
    return f > knee ? f * f * f : 3.0 * knee * knee * (f - 4.0 / 29.0);
}

// Linear sRGB of CIELAB (D65, 2 degrees), nothing clamped.
vec3 carpaint_lab_to_rgb(vec3 lab) {
    float y = (lab.x + 16.0) / 116.0;
    float x = y + lab.y / 500.0;
    float z = y - lab.z / 200.0;
    vec3 xyz = vec3(0.95047 * carpaint_expand(x), carpaint_expand(y), 1.08883 * carpaint_expand(z));
    return vec3(
        dot(vec3(3.240454836, -1.53713885, -0.4985315469), xyz),
        dot(vec3(-0.9692663899, 1.876010929, 0.04155608235), xyz),
        dot(vec3(0.0556434196, -0.2040258543, 1.057225162), xyz)
    );
}

// Color of one cluster's box at a place in it, 1/sr.
vec3 carpaint_box(int cluster, vec3 place) {
#ifdef CARPAINT_PAINTS
    // Weighted sums of the paints' corners; those that changed places by extrapolation are put in order.
    ivec2 size = textureSize(carpaint_corners_lower, 0);
    ivec2 at = carpaint_at(cluster, size.x);
    vec3 first = vec3(0.0);
    vec3 second = vec3(0.0);
    for (int m = 0; m < CARPAINT_PAINTS; ++m) {
        vec3 weight = carpaint_weights[m].yzz;
        first += weight * (texelFetch(carpaint_corners_lower, at, 0).rgb * carpaint_corner_scale + carpaint_corner_offset);
        second += weight * (texelFetch(carpaint_corners_upper, at, 0).rgb * carpaint_corner_scale + carpaint_corner_offset);
        at.y += size.y / CARPAINT_PAINTS;
    }
    vec3 lower = clamp(min(first, second), -2000.0, 2000.0);
    vec3 upper = clamp(max(first, second), -2000.0, 2000.0);
#else
    ivec2 at = carpaint_at(cluster, textureSize(carpaint_corners_lower, 0).x);
    vec3 lower = texelFetch(carpaint_corners_lower, at, 0).rgb * carpaint_corner_scale + carpaint_corner_offset;
    vec3 upper = texelFetch(carpaint_corners_upper, at, 0).rgb * carpaint_corner_scale + carpaint_corner_offset;
#endif
    return carpaint_lab_to_rgb(lower + (upper - lower) * place) / CARPAINT_PI;
}

// Color of one draw from the slice at these grid indices, 1/sr.
vec3 carpaint_slice(int theta_h, int theta_d, vec4 draw) {
    ivec2 range = ivec2(texelFetch(carpaint_slices, ivec2(theta_d, theta_h), 0).rg + 0.5);
#ifdef CARPAINT_ALIAS
    int cluster = carpaint_pick_alias(range.x, range.y, draw.x);
#else
    int cluster = carpaint_pick(range.x, range.y, draw.x);
#endif
    return carpaint_box(cluster, draw.yzw);
}

// Flakes of one cell at an angle pair inside the coat, 1/sr, may be slightly negative (a measurement's noise).
vec3 carpaint_flakes(uint cell, float theta_h_deg, float theta_d_deg) {
    if (carpaint_grid.z == 0) return vec3(0.0);
    vec4 draw = carpaint_draw(cell, theta_h_deg, theta_d_deg);
    CarpaintBracket row = carpaint_bracket(2, carpaint_grid.z, theta_h_deg);
    CarpaintBracket column = carpaint_bracket(3, carpaint_grid.w, theta_d_deg);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 4; ++k) {
        float wh = k < 2 ? 1.0 - row.fraction : row.fraction;
        float wd = (k & 1) == 0 ? 1.0 - column.fraction : column.fraction;
        if (wh * wd > 0.0) {
            sum += wh * wd * carpaint_slice(k < 2 ? row.low : row.high, (k & 1) == 0 ? column.low : column.high, draw);
        }
    }
    return sum;
}

// Mean flakes at an angle pair inside the coat, 1/sr.
vec3 carpaint_flakes_mean(float theta_h_deg, float theta_d_deg) {
    if (carpaint_grid.z == 0) return vec3(0.0);
    CarpaintBracket row = carpaint_bracket(2, carpaint_grid.z, theta_h_deg);
    CarpaintBracket column = carpaint_bracket(3, carpaint_grid.w, theta_d_deg);
    return carpaint_bilinear(carpaint_slice_means, row, column);
}

// Flakes under a pixel that is centred on `p` and spans `dx` and `dy`, all in texels: up to 16 texels are drawn, and
// where there are more their spread shrinks as that of a larger sample would. The mean is kept at every distance.
vec3 carpaint_flakes_area(vec2 p, vec2 dx, vec2 dy, float theta_h_deg, float theta_d_deg) {
    float texels = max(abs(dx.x * dy.y - dx.y * dy.x), 1.0);
    vec3 mean = carpaint_flakes_mean(theta_h_deg, theta_d_deg);
    if (texels > 4096.0) return mean;
    int n = texels < 2.0 ? 1 : texels < 9.0 ? 2 : 4;
    vec3 sum = vec3(0.0);
    for (int k = 0; k < n * n; ++k) {
        vec2 shift = (vec2(float(k % n), float(k / n)) + 0.5) / float(n) - 0.5;
        ivec2 texel = ivec2(floor(p + shift.x * dx + shift.y * dy));
        sum += carpaint_flakes(carpaint_cell(texel), theta_h_deg, theta_d_deg);
    }
    float drawn = float(n * n);
    return mean + (sum / drawn - mean) * min(1.0, sqrt(drawn / texels));
}

// ---- the whole paint ----

struct CarpaintTerms {
    CarpaintHalf angles; // inside the coat
    float transmission;  // T(i) T(o)
    vec3 base;
    float highlight;
};

CarpaintTerms carpaint_terms(vec3 wi, vec3 wo) {
    vec3 inner_i = carpaint_refract(wi, carpaint_coat.x);
    vec3 inner_o = carpaint_refract(wo, carpaint_coat.x);
    CarpaintTerms t;
    t.angles = carpaint_half(inner_i, inner_o);
    t.transmission = (1.0 - carpaint_fresnel(wi.z, carpaint_coat.x)) * (1.0 - carpaint_fresnel(wo.z, carpaint_coat.x));
    t.base = carpaint_base(t.angles, inner_i.z, inner_o.z);
    t.highlight = carpaint_highlight(wi, wo);
    return t;
}

vec3 carpaint_sum(CarpaintTerms t, vec3 flakes) {
    return max(t.transmission * (t.base + flakes) + t.highlight, 0.0);
}

// BRDF in 1/sr with flakes at their mean.
vec3 carpaint_evaluate(vec3 wi, vec3 wo) {
    if (wi.z <= 0.0 || wo.z <= 0.0) return vec3(0.0);
    CarpaintTerms t = carpaint_terms(wi, wo);
    return carpaint_sum(t, carpaint_flakes_mean(t.angles.theta_h_deg, t.angles.theta_d_deg));
}

// BRDF in 1/sr of one texel of the paint.
vec3 carpaint_shade(vec3 wi, vec3 wo, ivec2 texel) {
    if (wi.z <= 0.0 || wo.z <= 0.0) return vec3(0.0);
    CarpaintTerms t = carpaint_terms(wi, wo);
    return carpaint_sum(t, carpaint_flakes(carpaint_cell(texel), t.angles.theta_h_deg, t.angles.theta_d_deg));
}

// BRDF in 1/sr of the texels under a pixel: p, dx, dy in texels, such as a scaled uv with its dFdx and dFdy.
vec3 carpaint_shade_area(vec3 wi, vec3 wo, vec2 p, vec2 dx, vec2 dy) {
    if (wi.z <= 0.0 || wo.z <= 0.0) return vec3(0.0);
    CarpaintTerms t = carpaint_terms(wi, wo);
    return carpaint_sum(t, carpaint_flakes_area(p, dx, dy, t.angles.theta_h_deg, t.angles.theta_d_deg));
}
