uniform highp sampler2D u_total;
uniform highp sampler2D u_pass;
out vec4 color;
void main() { color = texelFetch(u_total, ivec2(gl_FragCoord.xy), 0) + texelFetch(u_pass, ivec2(gl_FragCoord.xy), 0); }
