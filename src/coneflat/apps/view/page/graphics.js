// A thin layer over WebGL 2: programs, vertex arrays, render targets and textures.

/** A shader program, with its uniforms by name. */
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

  /** Wait for the compiler, which runs asynchronously, and find the uniforms. */
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

  /** Use the program with these uniforms; names that it does not have are ignored. */
  use(values) {
    const gl = this.gl;
    gl.useProgram(this.handle);
    for (const [name, value] of Object.entries(values)) {
      const uniform = this.uniforms[name];
      if (!uniform) continue;
      if (uniform.type === gl.FLOAT) gl.uniform1f(uniform.at, value);
      else if (uniform.type === gl.FLOAT_VEC2) gl.uniform2fv(uniform.at, value);
      else if (uniform.type === gl.FLOAT_VEC4) gl.uniform4fv(uniform.at, value);
      else if (uniform.type === gl.FLOAT_VEC3) gl.uniform3fv(uniform.at, value);
      else if (uniform.type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(uniform.at, true, value);
      else if (uniform.type === gl.UNSIGNED_INT) gl.uniform1ui(uniform.at, value);
      else gl.uniform1i(uniform.at, Number(value));
    }
  }
}

/** Vertices to draw, three per triangle, given by attributes {array, size, type, normalised}. */
class Shape {
  constructor(gl, attributes) {
    this.gl = gl;
    this.handle = gl.createVertexArray();
    this.count = attributes[0].array.length / attributes[0].size;
    gl.bindVertexArray(this.handle);
    this.buffers = attributes.map(({array, size, type = gl.FLOAT, normalised = false}, location) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, type, normalised, 0, 0);
      return buffer;
    });
    gl.bindVertexArray(null);
  }

  discard() {
    this.buffers.forEach((buffer) => this.gl.deleteBuffer(buffer));
    this.gl.deleteVertexArray(this.handle);
  }

  /** Add or replace an attribute. */
  put(location, {array, size, type = this.gl.FLOAT, normalised = false}) {
    const gl = this.gl;
    if (this.buffers[location]) {
      this.refill(location, array);
      return;
    }
    gl.bindVertexArray(this.handle);
    gl.bindBuffer(gl.ARRAY_BUFFER, (this.buffers[location] = gl.createBuffer()));
    gl.bufferData(gl.ARRAY_BUFFER, array, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, size, type, normalised, 0, 0);
    gl.bindVertexArray(null);
  }

  refill(location, array) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffers[location]);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, array, this.gl.STATIC_DRAW);
  }

  /** Draw all vertices, or a number of them from the first on. */
  draw(count = this.count) {
    if (!count) return;
    this.gl.bindVertexArray(this.handle);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, count);
  }
}

/** A render target with a number of samples per pixel; with 0 its pixels can be read. */
class Target {
  constructor(gl, width, height, samples) {
    Object.assign(this, {gl, width, height, samples});
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    this.parts = [[gl.RGBA8, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]].map(([format, place]) => {
      const part = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, part);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, part);
      return part;
    });
  }

  fits(width, height, samples) {
    return this.width === width && this.height === height && this.samples === samples;
  }

  /** Draw into a box (left, bottom, width, height) from now on, and clear it. */
  begin(colour, box) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(...box);
    gl.scissor(...box);
    gl.enable(gl.SCISSOR_TEST);
    gl.clearColor(...colour);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }

  /** Copy a box to a box of the canvas; with several samples per pixel the boxes must be equal. */
  show([left, bottom, width, height], [toLeft, toBottom, toWidth, toHeight]) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.frame);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    const from = [left, bottom, left + width, bottom + height], to = [toLeft, toBottom, toLeft + toWidth, toBottom + toHeight];
    gl.blitFramebuffer(...from, ...to, gl.COLOR_BUFFER_BIT, this.samples ? gl.NEAREST : gl.LINEAR);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  discard() {
    this.gl.deleteFramebuffer(this.frame);
    this.parts.forEach((part) => this.gl.deleteRenderbuffer(part));
  }
}

/** Return a texture of a colour table, (k, 3) bytes. */
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

/** Return a texture of an image, row 0 at the top, with mipmaps; repeats: outside the unit square, too. */
function pictureTexture(gl, source, repeats) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, source);
  gl.generateMipmap(gl.TEXTURE_2D);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, repeats ? gl.REPEAT : gl.CLAMP_TO_EDGE);
  const sharper = gl.getExtension("EXT_texture_filter_anisotropic");
  if (sharper) gl.texParameterf(gl.TEXTURE_2D, sharper.TEXTURE_MAX_ANISOTROPY_EXT, 8);
  return texture;
}

/** Return a CSS colour as three numbers from 0 to 1. */
function rgb(text) {
  const value = parseInt(text.trim().slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255].map((x) => x / 255);
}
