// Inputs that vary over a surface: attributes, and images with four neighbours or the closest texel. The same as material.cpp, surface.cpp
// and texture.cpp have for one point. Letters: u v of the unit square, i index in an endless row of texels.
#pragma once
#include "lanes.h"
#include "stages.h"

namespace glint {
namespace {

/// A group of points on their meshes; rows beyond the last point repeat the first.
struct OnMesh {
  const GlintGeometry* geometry[kLanes];
  uint32_t primitive[kLanes];
  Doubles weights[3];
};

struct Color {
  Three color;
  Doubles alpha;
};

inline const GlintAttribute* find(const VaryStage& s, const GlintGeometry& geometry, int32_t name) {
  const GlintAttribute* a = s.attributes + geometry.first_attribute;
  for (uint32_t i = 0; i < geometry.attribute_count; ++i)
    if (name < 0 ? a[i].channels == 2 : a[i].name == name) return a + i;
  return nullptr;
}

/// An attribute's values at the three corners; 0 where a geometry lacks it, or a channel of it.
struct Corners {
  float at[3][4][kLanes] = {};
  int channels[kLanes];
};

inline void look_up(const GlintGeometry& geometry, const GlintAttribute& a, uint32_t primitive, size_t lane, Corners& out) {
  const uint32_t* rows = (a.domain == GLINT_CORNER ? geometry.corners : geometry.triangles) + 3 * size_t(primitive);
  for (size_t v = 0; v < 3; ++v) {
    const float* p = a.values + size_t(a.channels) * (a.domain == GLINT_FACE ? primitive : rows[v]);
    for (int c = 0; c < a.channels && c < 4; ++c) out.at[v][c][lane] = p[c];
  }
}

inline void look_up(const VaryStage& s, const OnMesh& p, int32_t name, Corners& out) {
  const GlintAttribute* attribute = nullptr;
  for (size_t lane = 0; lane < kLanes; ++lane) {
    if (lane == 0 || p.geometry[lane] != p.geometry[lane - 1]) attribute = find(s, *p.geometry[lane], name);
    out.channels[lane] = attribute ? attribute->channels : 0;
    if (attribute) look_up(*p.geometry[lane], *attribute, p.primitive[lane], lane, out);
  }
}

inline Doubles blend(const OnMesh& p, const Corners& values, int channel) {
  const Doubles a = load(values.at[0][channel]), b = load(values.at[1][channel]), c = load(values.at[2][channel]);
  return finite_or_zero(p.weights[0] * a + p.weights[1] * b + p.weights[2] * c);
}

inline Color color_at(const VaryStage& s, const OnMesh& p, int32_t name) {
  Corners values;
  look_up(s, p, name, values);
  Color c{{blend(p, values, 0), blend(p, values, 1), blend(p, values, 2)}, blend(p, values, 3)};
  for (size_t lane = 0; lane < kLanes; ++lane)
    if (values.channels[lane] < 4) c.alpha[lane] = values.channels[lane] > 0 ? 1 : 0;
  return c;
}

inline Doubles clamped(Doubles x, double low, double high) { return choose(x < low, splat(low), choose(x > high, splat(high), x)); }

inline Doubles reduce(Doubles x, int extension) {
  x = finite_or_zero(x);
  if (extension == GLINT_REPEAT) return x - down(x);
  if (extension == GLINT_MIRRORED) return x - 2 * down(0.5 * x);
  return clamped(x, -2, 3);
}

inline Whole wrap(Doubles i, double size, int extension) {
  if (extension == GLINT_EXTEND) return whole(clamped(i, 0, size - 1));
  if (extension == GLINT_CLIP) return whole(choose((i >= 0) & (i < size), i, splat(-1)));
  const double period = extension == GLINT_MIRRORED ? 2 * size : size;
  i = i + choose(i < 0, splat(period), choose(i >= period, splat(-period), splat(0)));
  return whole(choose(i < size, i, 2 * size - 1 - i));
}

/// The two texels next to a coordinate and the way between them.
struct Axis {
  Whole first, second;
  Doubles way;
};

inline Axis axis_of(const TextureShape& t, Doubles x, double size) {
  const Doubles at = reduce(x, t.extension) * size;
  if (t.interpolation == GLINT_CLOSEST) return {wrap(down(at), size, t.extension), Whole{}, Doubles{}};
  const Doubles first = down(at - 0.5);
  return {wrap(first, size, t.extension), wrap(first + 1, size, t.extension), at - 0.5 - first};
}

inline Color texels(const TextureShape& t, Whole column, Whole row) {
  Color c{};
  for (size_t lane = 0; lane < kLanes; ++lane) {
    if (column[lane] < 0 || row[lane] < 0) continue;
    const size_t at = 4 * (size_t(row[lane]) * t.width + size_t(column[lane]));
    if (t.type == GLINT_FLOAT32) {
      const float* p = static_cast<const float*>(t.pixels) + at;
      c.color.x[lane] = p[0], c.color.y[lane] = p[1], c.color.z[lane] = p[2], c.alpha[lane] = p[3];
    } else {
      const uint8_t* p = static_cast<const uint8_t*>(t.pixels) + at;
      c.color.x[lane] = t.decode[p[0]], c.color.y[lane] = t.decode[p[1]], c.color.z[lane] = t.decode[p[2]], c.alpha[lane] = t.linear[p[3]];
    }
  }
  return c;
}

inline Color mix(const Color& a, const Color& b, Doubles t) {
  return {(1 - t) * a.color + t * b.color, (1 - t) * a.alpha + t * b.alpha};
}

inline Color sample(const TextureShape& t, Doubles u, Doubles v) {
  const Axis x = axis_of(t, u, t.width), y = axis_of(t, v, t.height);
  if (t.interpolation == GLINT_CLOSEST) return texels(t, x.first, y.first);
  return mix(mix(texels(t, x.first, y.first), texels(t, x.second, y.first), x.way),
             mix(texels(t, x.first, y.second), texels(t, x.second, y.second), x.way), y.way);
}

inline Three channel_of(const Color& c, int channel) {
  if (channel == GLINT_ALPHA) return {c.alpha, c.alpha, c.alpha};
  if (channel != GLINT_LUMINANCE) return c.color;
  const Doubles grey = (c.color.x + c.color.y + c.color.z) / 3;
  return {grey, grey, grey};
}

/// What was read of images for a group of points: inputs of several lobes often ask for the same.
struct Reads {
  static constexpr uint32_t kKept = 8;
  uint32_t count = 0, number[kKept];
  Color color[kKept];
};

inline Color read_image(const VaryStage& s, const OnMesh& p, const GlintInput& input) {
  Corners uv;
  look_up(s, p, input.uv, uv);
  const double* m = input.uv_transform;
  Mask has = {};
  for (size_t lane = 0; lane < kLanes; ++lane) has[lane] = uv.channels[lane] >= 2 ? -1 : 0;
  const Doubles x = where(has, blend(p, uv, 0)), y = where(has, blend(p, uv, 1));
  return sample(s.textures[input.texture], m[0] * x + m[1] * y + m[2], m[3] * x + m[4] * y + m[5]);
}

inline Color image_at(const VaryStage& s, const OnMesh& p, uint32_t i, Reads& reads) {
  const uint32_t number = s.reads[i];
  for (uint32_t k = 0; k < reads.count; ++k)
    if (reads.number[k] == number) return reads.color[k];
  const Color color = read_image(s, p, s.inputs[i]);
  if (reads.count < Reads::kKept) reads.color[reads.count] = color, reads.number[reads.count++] = number;
  return color;
}

inline Three finite_or_zero(const Three& a) { return {finite_or_zero(a.x), finite_or_zero(a.y), finite_or_zero(a.z)}; }

inline Three evaluate(const VaryStage& s, const OnMesh& p, uint32_t i, Reads& reads) {
  const GlintInput& input = s.inputs[i];
  Three product = splat3(input.value);
  if (input.texture >= 0) product = product * channel_of(image_at(s, p, i, reads), input.channel);
  if (input.attribute >= 0) product = product * channel_of(color_at(s, p, input.attribute), input.attribute_channel);
  product = finite_or_zero(product);
  return input.complement ? Three{1 - product.x, 1 - product.y, 1 - product.z} : product;
}

/// The product of a lobe's factors.
inline Three coefficient(const VaryStage& s, const OnMesh& p, const LobeShape& lobe, Reads& reads) {
  if (lobe.constant) return splat3(lobe.k);
  Three k = {splat(1), splat(1), splat(1)};
  for (uint32_t i = 0; i < lobe.input_count; ++i) k = k * evaluate(s, p, lobe.first_input + i, reads);
  return finite_or_zero(k);
}

}  // namespace
}  // namespace glint
