#version 400 core
layout(location = 0) in vec3 position;
layout(location = NORMAL_LOC) in vec3 normal;
layout(location = TEXCOORD_0_LOC) in vec2 texcoord_0;

uniform mat4 V;
uniform mat4 P;

out vec3 frag_position;
out vec3 frag_normal;
out vec2 uv_0;

void main()
{
    gl_Position = P * (V * vec4(position, 1.0));
    frag_position = position;
    frag_normal = normal;
    uv_0 = texcoord_0;
}
