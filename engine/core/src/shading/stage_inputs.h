// Inputs that vary over a surface: attributes and images. Letters: u v of the unit square.
#pragma once
#include "shading/stage_images.h"
#include "shading/stages.h"
#include "simd/lanes.h"

namespace glint {
namespace {

/// A group of points on their meshes; rows beyond the last point repeat the first.
struct OnMesh {
  size_t different;  // 1 where all are on one primitive, else kLanes
  const GlintGeometry* geometry[kLanes];
  uint32_t primitive[kLanes];
  Doubles weights[3];
  const double* slots = nullptr;  // of the material's program, from the first lane on
};

/// Where the points of a group are, from the instance and the primitive of each lane.
template <class Instance, class Primitive>
inline void find_primitives(const InputTables& s, Instance instance, Primitive primitive,
                            OnMesh& p) {
  for (size_t lane = 0; lane < kLanes; ++lane) {
    p.geometry[lane] = s.geometries + s.groups[s.instances[instance(lane)].group].geometry;
    p.primitive[lane] = primitive(lane);
  }
  bool one = same(p.primitive);
  for (size_t lane = 1; one && lane < kLanes; ++lane) one = p.geometry[lane] == p.geometry[0];
  p.different = one ? 1 : kLanes;
}

/// A colour, or its Rec. 709 luminance as grey.
inline Three channel_of(const Three& color, int channel) {
  if (channel != GLINT_LUMINANCE) return color;
  const Doubles grey = 0.2126 * color.x + 0.7152 * color.y + 0.0722 * color.z;
  return {grey, grey, grey};
}

inline const GlintAttribute* find(const InputTables& s, const GlintGeometry& geometry,
                                  int32_t name) {
  const GlintAttribute* a = s.attributes + geometry.first_attribute;
  for (uint32_t i = 0; i < geometry.attribute_count; ++i)
    if (name < 0 ? a[i].channels == 2 : a[i].name == name) return a + i;
  return nullptr;
}

/// Where an attribute's values at the three corners are. A geometry may lack it, or some of its
/// channels: those are 0.
struct Corners {
  const float* at[3][kLanes];
  int channels[kLanes] = {};
  bool alike = true;  // as many channels in all lanes
};

inline void look_up(const GlintGeometry& geometry, const GlintAttribute& a, uint32_t primitive,
                    size_t lane, Corners& out) {
  const uint32_t* rows = a.domain == GLINT_CORNER ? geometry.corners : geometry.triangles;
  for (size_t v = 0; v < 3; ++v)
    out.at[v][lane] =
        a.values +
        size_t(a.channels) * (a.domain == GLINT_FACE ? primitive : rows[3 * size_t(primitive) + v]);
}

inline void look_up(const InputTables& s, const OnMesh& p, int32_t name, Corners& out) {
  const GlintAttribute* attribute = nullptr;
  for (size_t lane = 0; lane < p.different; ++lane) {
    if (lane == 0 || p.geometry[lane] != p.geometry[lane - 1])
      attribute = find(s, *p.geometry[lane], name);
    out.channels[lane] = attribute ? attribute->channels : 0;
    out.alike = out.alike && out.channels[lane] == out.channels[0];
    if (attribute) look_up(*p.geometry[lane], *attribute, p.primitive[lane], lane, out);
  }
}

/// One channel at one corner.
inline Doubles corner(const OnMesh& p, const Corners& values, size_t v, int channel) {
  if (values.alike && values.channels[0] <= channel) return Doubles{};
  if (p.different == 1) return splat(values.at[v][0][channel]);
  const auto value = [&](size_t lane) { return values.at[v][lane][channel]; };
  const auto any_value = [&](size_t lane) {
    return values.channels[lane] > channel ? value(lane) : 0.0f;
  };
  return __builtin_convertvector(
      values.alike ? each_lane<Singles>(value) : each_lane<Singles>(any_value), Doubles);
}

inline Doubles blend(const OnMesh& p, const Corners& values, int channel) {
  const Doubles a = corner(p, values, 0, channel), b = corner(p, values, 1, channel),
                c = corner(p, values, 2, channel);
  return finite_or_zero(p.weights[0] * a + p.weights[1] * b + p.weights[2] * c);
}

/// Lanes that have at least so many channels.
inline Mask lanes_with(const Corners& values, int channels) {
  if (values.alike) return values.channels[0] >= channels ? ~Mask{} : Mask{};
  Mask has{};
  for (size_t lane = 0; lane < kLanes; ++lane)
    has[lane] = values.channels[lane] >= channels ? -1 : 0;
  return has;
}

inline Three read_color(const InputTables& s, const OnMesh& p, int32_t name, int channel) {
  Corners values;
  look_up(s, p, name, values);
  if (channel != GLINT_ALPHA)
    return {blend(p, values, 0), blend(p, values, 1), blend(p, values, 2)};
  const Doubles alpha =
      choose(lanes_with(values, 4), blend(p, values, 3), where(lanes_with(values, 1), splat(1)));
  return {alpha, alpha, alpha};
}

/// What was read for a group of points, by number: inputs of several lobes often ask for the same.
class Recent {
 public:
  /// The value of that number, which `read` makes.
  template <class Read>
  Three get(uint32_t number, Read read) {
    for (uint32_t k = 0; k < count_; ++k)
      if (number_[k] == number) return value_[k];
    const Three value = read();
    if (count_ < kMost) {
      value_[count_] = value;
      number_[count_++] = number;
    }
    return value;
  }

 private:
  static constexpr uint32_t kMost = 8;
  uint32_t count_ = 0, number_[kMost];
  Three value_[kMost];
};

/// Images and attributes: the colour, or the alpha three times.
struct Reads {
  Recent images, colors;
};

struct Uvs {
  Doubles u, v;
};

/// A UV map, the active one for -1; zeros where the geometry lacks it.
inline Uvs read_uv(const InputTables& s, const OnMesh& p, int32_t name) {
  Corners uv;
  look_up(s, p, name, uv);
  const Mask has = lanes_with(uv, 2);
  return {where(has, blend(p, uv, 0)), where(has, blend(p, uv, 1))};
}

inline Three read_image(const InputTables& s, const OnMesh& p, const GlintInput& input) {
  const double* m = input.uv_transform;
  const Uvs at = read_uv(s, p, input.uv);
  const Doubles u = m[0] * at.u + m[1] * at.v + m[2], v = m[3] * at.u + m[4] * at.v + m[5];
  const TextureShape& t = s.textures[input.texture];
  if (input.channel != GLINT_ALPHA) return sample_color(t, u, v);
  const Doubles alpha = sample_alpha(t, u, v);
  return {alpha, alpha, alpha};
}

inline Three image_at(const InputTables& s, const OnMesh& p, uint32_t i, Reads& reads) {
  return reads.images.get(s.reads[i], [&] { return read_image(s, p, s.inputs[i]); });
}

inline Three color_at(const InputTables& s, const OnMesh& p, int32_t name, int channel,
                      Reads& reads) {
  const uint32_t number = 2 * uint32_t(name) + (channel == GLINT_ALPHA);
  return reads.colors.get(number, [&] { return read_color(s, p, name, channel); });
}

template <size_t N>
inline void put3(double (&columns)[3][N], size_t k, const Three& v) {
  store(columns[0] + k, v.x);
  store(columns[1] + k, v.y);
  store(columns[2] + k, v.z);
}

inline Three finite_or_zero(const Three& a) {
  return {finite_or_zero(a.x), finite_or_zero(a.y), finite_or_zero(a.z)};
}

inline Three bounded(const Three& a, double low, double high) {
  return {clamped(a.x, low, high), clamped(a.y, low, high), clamped(a.z, low, high)};
}

/// What a program left in a slot, of which the ABI has the number plus one.
inline Doubles slot(const OnMesh& p, int32_t number) {
  return load(p.slots + size_t(number - 1) * kBlock);
}
inline Three slots3(const OnMesh& p, int32_t number) {
  return {slot(p, number), slot(p, number + 1), slot(p, number + 2)};
}

inline Three evaluate(const InputTables& s, const OnMesh& p, uint32_t i, Reads& reads) {
  const GlintInput& input = s.inputs[i];
  Three product = splat3(input.value);
  if (input.texture >= 0) product = product * channel_of(image_at(s, p, i, reads), input.channel);
  const int channel = input.attribute_channel;
  if (input.attribute >= 0)
    product = product * channel_of(color_at(s, p, input.attribute, channel, reads), channel);
  if (input.output > 0) product = product * slots3(p, input.output);
  product = finite_or_zero(product);
  if (input.bounded) product = bounded(product + splat3(input.offset), input.low, input.high);
  return input.complement ? Three{1 - product.x, 1 - product.y, 1 - product.z} : product;
}

/// The product of a lobe's factors where they vary: one copy for all stages.
__attribute__((noinline, flatten)) Three product(const InputTables& s, const OnMesh& p,
                                                 const LobeShape& lobe, Reads& reads) {
  Three k = {splat(1), splat(1), splat(1)};
  for (uint32_t i = 0; i < lobe.input_count; ++i)
    k = k * evaluate(s, p, lobe.first_input + i, reads);
  return finite_or_zero(k);
}

inline Three coefficient(const InputTables& s, const OnMesh& p, const LobeShape& lobe,
                         Reads& reads) {
  return lobe.constant ? splat3(lobe.k) : product(s, p, lobe, reads);
}

void coefficients(const CoefficientStage& s) {
  for (size_t i = 0; i < s.count; i += kLanes) {
    OnMesh p;
    find_primitives(
        s.tables, [&](size_t lane) { return s.points->instance[i + lane]; },
        [&](size_t lane) { return s.points->primitive[i + lane]; }, p);
    for (size_t v = 0; v < 3; ++v) p.weights[v] = load(s.points->weights[v] + i);
    if (s.slots) p.slots = s.slots + i;
    Reads reads;
    store3(s.k, i, coefficient(s.tables, p, *s.lobe, reads));
  }
}

constexpr double kLeastIor = 1e-30, kMostIor = 1e30;  // their squares are finite, one over them too

/// The index of refraction of a lobe: what the program gives, where that is one, else its own.
inline Doubles lobe_ior(const OnMesh& p, const LobeShape& lobe) {
  if (lobe.ior_slot == 0) return splat(lobe.ior);
  const Doubles given = slot(p, lobe.ior_slot);
  return choose((given >= kLeastIor) & (given <= kMostIor), given, splat(lobe.ior));
}

}  // namespace
}  // namespace glint
