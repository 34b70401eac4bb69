/* A plane of a material under a light that follows the pointer: `relight(canvas, maps)`. */
"use strict";

/** Draw two materials side by side: maps is [[albedo, normals, copies], ...], pictures as addresses. */
function relight(canvas, maps) {
  const gl = canvas.getContext("webgl");
  if (!gl) return;
  const shaders = {
    VERTEX_SHADER: "attribute vec2 at; varying vec2 p; void main() { p = at; gl_Position = vec4(at, 0, 1); }",
    FRAGMENT_SHADER: `precision mediump float;
      varying vec2 p;
      uniform sampler2D colour, normal;
      uniform float copies;
      uniform vec2 light; // in the plane, from -1 to 1
      void main() {
        vec2 uv = vec2(p.x + 1.0, 1.0 - p.y) / 2.0 * copies;
        vec3 n = normalize(texture2D(normal, uv).xyz * 2.0 - 1.0);
        float lit = max(dot(n, normalize(vec3(light - p, 0.5))), 0.0);
        gl_FragColor = vec4(texture2D(colour, uv).rgb * (0.25 + 1.1 * lit), 1);
      }`,
  };
  const program = gl.createProgram();
  for (const [kind, text] of Object.entries(shaders)) {
    const shader = gl.createShader(gl[kind]);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  gl.enableVertexAttribArray(0);
  const place = (name) => gl.getUniformLocation(program, name);
  gl.uniform1i(place("normal"), 1);

  const side = canvas.height;
  const textures = maps.map((both) => both.slice(0, 2).map((address) => {
    const texture = gl.createTexture();
    const picture = new Image();
    picture.onload = () => {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, picture);
      gl.generateMipmap(gl.TEXTURE_2D);
      draw([-0.5, 0.6]);
    };
    picture.src = address;
    return texture;
  }));

  function draw(light) {
    gl.uniform2fv(place("light"), light);
    textures.forEach((both, index) => {
      gl.viewport(index * (canvas.width - side), 0, side, side);
      both.forEach((texture, unit) => {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, texture);
      });
      gl.uniform1f(place("copies"), maps[index][2]);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    });
  }

  canvas.onpointermove = (event) => {
    const box = canvas.getBoundingClientRect();
    const across = ((event.clientX - box.left) / box.width) * canvas.width % (canvas.width - side);
    draw([(2 * across) / side - 1, 1 - (2 * (event.clientY - box.top)) / box.height]);
  };
}
