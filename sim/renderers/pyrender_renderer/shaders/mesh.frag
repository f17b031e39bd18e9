#version 400 core
// The light of a sim.scene.Scene: ambient light that is stronger from above, and point lights of power / (1 + d^2)
// whose shadows are looked up in maps drawn straight down from each. Brightness above a knee is compressed.

struct SpotLight {
    vec3 position;
    float intensity;
    sampler2D shadow_map;
    mat4 light_matrix;
};

struct Material {
    sampler2D base_color_texture;
};

uniform SpotLight spot_lights[MAX_SPOT_LIGHTS];
uniform int n_spot_lights;
uniform vec3 ambient_light;
uniform Material material;

in vec3 frag_position;
in vec3 frag_normal;
in vec2 uv_0;

out vec4 frag_color;

const float AMBIENT_FROM_ABOVE = 0.25;
const float BRIGHTNESS_KNEE = 0.7;
const float SHADOW_TANGENT = 2.75;        // half the width of a shadow map per metre below the light
const float SHADOW_OFFSET_TEXELS = 2.2;   // along the normal, against self-shadowing
const float SHADOW_OFFSET_MIN = 0.005;    // metres
const float SHADOW_DEPTH_BIAS = 0.01;     // metres

// Share of the light that reaches a point: the mean of 3x3 bilinear depth tests (percentage closer filtering;
// Reeves, Salesin, Cook 1987), which is 4x4 tests with the weights (1 - f, 1, 1, f) / 3 along each axis.
float lit_share(SpotLight light, vec3 n)
{
    float size = float(textureSize(light.shadow_map, 0).x);
    float below = light.position.z - frag_position.z;
    vec3 p = frag_position + n * max(below * SHADOW_OFFSET_TEXELS * 2.0 * SHADOW_TANGENT / size, SHADOW_OFFSET_MIN);
    vec3 to_light = light.position - p;
    p += to_light * (SHADOW_DEPTH_BIAS / to_light.z);  // along the ray: it stays on its texel
    vec4 clip = light.light_matrix * vec4(p, 1.0);
    vec3 ndc = clip.xyz / clip.w;
    vec2 texel = (ndc.xy * 0.5 + 0.5) * size - 0.5;
    if (clip.w <= 0.0 || any(lessThan(texel, vec2(1.0))) || any(greaterThanEqual(texel, vec2(size - 2.0))))
        return 1.0;
    float depth = ndc.z * 0.5 + 0.5;
    vec2 corner = floor(texel), f = texel - corner;
    float total = 0.0;
    for (int part = 0; part < 4; part++) {  // 2x2 texels each; a gather starts above the lower left one, clockwise
        vec2 side = vec2(part & 1, part >> 1);
        vec4 nearest = textureGather(light.shadow_map, (corner + 2.0 * side) / size);
        vec2 low = mix(1.0 - f, vec2(1.0), side), high = mix(vec2(1.0), f, side);
        vec4 weights = vec4(low.x * high.y, high.x * high.y, high.x * low.y, low.x * low.y);
        total += dot(weights, vec4(greaterThanEqual(nearest, vec4(depth))));
    }
    return total / 9.0;
}

void main()
{
    vec3 n = normalize(frag_normal);
    float brightness = ambient_light.r * (1.0 + AMBIENT_FROM_ABOVE * n.z);
    for (int i = 0; i < n_spot_lights; i++) {
        vec3 to_light = spot_lights[i].position - frag_position;
        float squared = dot(to_light, to_light);
        float share = max(dot(to_light, n), 0.0) * spot_lights[i].intensity / (sqrt(squared) * (1.0 + squared));
        if (share > 0.0)
            brightness += share * lit_share(spot_lights[i], n);
    }
    float over = max(brightness - BRIGHTNESS_KNEE, 0.0);
    float room = 1.0 - BRIGHTNESS_KNEE;
    brightness = min(brightness, BRIGHTNESS_KNEE) + room * over / (over + room);
    // The mip level of an isotropic filter: by the area that a pixel covers, not by its longer side.
    vec2 size = vec2(textureSize(material.base_color_texture, 0));
    vec2 right = dFdx(uv_0) * size, up = dFdy(uv_0) * size;
    float level = 0.5 * log2(max(abs(right.x * up.y - right.y * up.x), 1.0));
    frag_color = vec4(textureLod(material.base_color_texture, uv_0, level).rgb * brightness, 1.0);
}
