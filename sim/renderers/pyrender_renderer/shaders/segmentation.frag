#version 400 core
flat in float instance_id;
in vec3 position_camera;

layout(location = 0) out vec4 truth;
layout(location = 1) out vec4 normal;

void main()
{
    truth = vec4(instance_id, 1.0 / gl_FragCoord.w, 0.0, 1.0);  // w of the clip space is z of the camera, metres
    // Of the flat triangle, turned towards the camera; OpenGL's axes to the camera's of the records.
    vec3 n = cross(dFdx(position_camera), dFdy(position_camera));
    n *= vec3(1.0, -1.0, -1.0) * (dot(n, position_camera) > 0.0 ? -1.0 : 1.0) / max(length(n), 1e-30);
    normal = vec4(n, 0.0);
}
