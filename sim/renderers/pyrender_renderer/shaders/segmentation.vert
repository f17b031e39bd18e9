#version 400 core
// The truth: texture coordinates of the solid meshes carry the instance id.
layout(location = 0) in vec3 position;
layout(location = TEXCOORD_0_LOC) in vec2 texcoord_0;

uniform mat4 V;
uniform mat4 P;

flat out float instance_id;
out vec3 position_camera;

void main()
{
    vec4 seen = V * vec4(position, 1.0);
    gl_Position = P * seen;
    position_camera = seen.xyz;
    instance_id = texcoord_0.x;
}
