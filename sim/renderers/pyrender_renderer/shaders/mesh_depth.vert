#version 400 core
// What a light sees: depth alone.
layout(location = 0) in vec3 position;

uniform mat4 V;
uniform mat4 P;

void main()
{
    gl_Position = P * (V * vec4(position, 1.0));
}
