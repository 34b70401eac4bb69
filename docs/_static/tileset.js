// Draws an endless plane of corner tiles by the function that the page shows, in GLSL; dragging moves it.
addEventListener("DOMContentLoaded", () => {
  const canvas = document.querySelector("canvas.tileset");
  const code = document.querySelector(".tileset-glsl pre");
  const gl = canvas && code && canvas.getContext("webgl2");
  if (!gl) return canvas?.replaceWith("This browser has no WebGL 2.");
  const program = gl.createProgram();
  for (const [kind, text] of [
    [gl.VERTEX_SHADER, `#version 300 es
      in vec2 place;
      void main() { gl_Position = vec4(place, 0, 1); }`],
    [gl.FRAGMENT_SHADER, `#version 300 es
      precision highp float;
      precision highp int;
      uniform sampler2D tiles;
      uniform vec2 origin;
      uniform float side, height;
      out vec4 colour;
      ${code.textContent}
      void main() {
        colour = cornerTiles(tiles, origin + vec2(gl_FragCoord.x, height - gl_FragCoord.y) / side);
      }`],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return canvas.replaceWith("The shader does not compile here.");
  gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(gl.getAttribLocation(program, "place"));
  gl.vertexAttribPointer(gl.getAttribLocation(program, "place"), 2, gl.FLOAT, false, 0, 0);
  const at = (name) => gl.getUniformLocation(program, name);
  const origin = [0, 0];
  let side = 64; // pixels of a tile
  const draw = () => {
    gl.uniform2fv(at("origin"), origin);
    gl.uniform1f(at("side"), side);
    gl.uniform1f(at("height"), canvas.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    canvas.dataset.drawn = "yes";
  };
  const picture = new Image();
  picture.onload = () => {
    side = picture.naturalWidth / 4;
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D); // repeats in both directions, as all textures unless told otherwise
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    draw();
  };
  picture.src = window.tiles;
  canvas.onpointermove = (event) => {
    if (!event.buttons) return;
    const scale = canvas.width / canvas.clientWidth / side;
    origin[0] -= event.movementX * scale;
    origin[1] -= event.movementY * scale;
    draw();
  };
});
