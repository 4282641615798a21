// The little of WebGL 2 that the page needs.

/** A program, with its uniforms by name. */
class Program {
  constructor(gl, vertex, fragment, picks) {
    const head = `#version 300 es\n${picks ? "#define PICK\n" : ""}precision highp float;\nprecision highp int;\n`;
    this.gl = gl;
    this.handle = gl.createProgram();
    this.shaders = [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]].map(([kind, source]) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, head + source);
      gl.compileShader(shader);
      gl.attachShader(this.handle, shader);
      return shader;
    });
    gl.linkProgram(this.handle);
  }

  /** Wait for the compiler, which works by itself meanwhile, and find the uniforms. */
  finish() {
    const gl = this.gl;
    if (!gl.getProgramParameter(this.handle, gl.LINK_STATUS) && !gl.isContextLost()) {
      const reasons = this.shaders.map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`cannot draw here: ${[gl.getProgramInfoLog(this.handle), ...reasons].join(" ")}`);
    }
    this.uniforms = {};
    const count = gl.getProgramParameter(this.handle, gl.ACTIVE_UNIFORMS) || 0;
    for (let i = 0; i < count; i++) {
      const {name, type} = gl.getActiveUniform(this.handle, i);
      this.uniforms[name] = {at: gl.getUniformLocation(this.handle, name), type};
    }
  }

  /** Use it with these values; a name that the program does not have is passed over. */
  use(values) {
    const gl = this.gl;
    gl.useProgram(this.handle);
    for (const [name, value] of Object.entries(values)) {
      const uniform = this.uniforms[name];
      if (!uniform) continue;
      if (uniform.type === gl.FLOAT) gl.uniform1f(uniform.at, value);
      else if (uniform.type === gl.FLOAT_VEC2) gl.uniform2fv(uniform.at, value);
      else if (uniform.type === gl.FLOAT_VEC3) gl.uniform3fv(uniform.at, value);
      else if (uniform.type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(uniform.at, true, value);
      else if (uniform.type === gl.UNSIGNED_INT) gl.uniform1ui(uniform.at, value);
      else gl.uniform1i(uniform.at, Number(value));
    }
  }
}

/** Attributes of a drawing: a list of {array, size, type, normalised, stride, offset, each}. */
class Shape {
  constructor(gl, attributes) {
    this.gl = gl;
    this.handle = gl.createVertexArray();
    this.buffers = [];
    gl.bindVertexArray(this.handle);
    attributes.forEach((a, location) => {
      const buffer = a.buffer ?? gl.createBuffer();
      this.buffers.push(buffer);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      if (a.array) gl.bufferData(gl.ARRAY_BUFFER, a.array, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, a.size, a.type ?? gl.FLOAT, Boolean(a.normalised), a.stride ?? 0, a.offset ?? 0);
      gl.vertexAttribDivisor(location, a.each ?? 0);
    });
    gl.bindVertexArray(null);
  }

  refill(location, array) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffers[location]);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, array, this.gl.STATIC_DRAW);
  }

  /** Lines and dots: four corners for each instance. */
  drawEach(count) {
    if (!count) return;
    this.gl.bindVertexArray(this.handle);
    this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, count);
  }

  drawTriangles(count) {
    this.gl.bindVertexArray(this.handle);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3 * count);
  }
}

/** Return a texture of a table of colours, (k, 3) bytes. */
function tableTexture(gl, colours, smooth) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, colours.length / 3, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colours);
  const filter = smooth ? gl.LINEAR : gl.NEAREST;
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  return texture;
}

/** Return a texture of a picture, row 0 at its top, with mipmaps. */
function pictureTexture(gl, source) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, source);
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  const sharper = gl.getExtension("EXT_texture_filter_anisotropic");
  if (sharper) gl.texParameterf(gl.TEXTURE_2D, sharper.TEXTURE_MAX_ANISOTROPY_EXT, 8);
  return texture;
}

/** Return a CSS colour as three numbers, 0 to 1. */
function rgb(text) {
  const value = parseInt(text.trim().slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255].map((x) => x / 255);
}
