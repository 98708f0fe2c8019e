#include "scene/opacity_map.h"

#include <algorithm>
#include <cmath>

#include "scene/scene.h"

namespace glint {
namespace {

/// The point that is shaded may differ by so much from the weights of a hit
/// (shading/stage_surface.h, solve_weights), with room for float.
constexpr double kOff = 1.001e-3;
constexpr double kMostOff = 0.5;  // texels
constexpr double kFarOut = 1e6;   // of an image's repetitions, so that texels have their digits

/// The floor of a number of moderate size: without a call, which it takes on the oldest processors.
int64_t down(double x) {
  const int64_t i = int64_t(x);
  return i - (x < double(i));
}

uint8_t reading(double value) {
  return value == 0 ? TexelMap::kZero : value == 1 ? TexelMap::kOne : TexelMap::kMixed;
}

uint8_t reading_of(const TextureShape& t, size_t texel, bool of_alpha) {
  uint8_t all = TexelMap::kZero | TexelMap::kOne;
  for (size_t at = 4 * texel + (of_alpha ? 3 : 0), end = 4 * texel + (of_alpha ? 4 : 3); at < end;
       ++at) {
    if (t.type == GLINT_FLOAT32) all &= reading(double(static_cast<const float*>(t.pixels)[at]));
    else
      all &= reading((of_alpha ? t.linear : t.decode)[static_cast<const uint8_t*>(t.pixels)[at]]);
  }
  return all;
}

/// The texel after the last one.
size_t next(size_t i, size_t size, int extension) {
  return i + 1 < size ? i + 1 : extension == GLINT_REPEAT ? 0 : i;
}

}  // namespace

TexelMap::TexelMap(const TextureShape& texture, bool of_alpha) : texture_(texture) {
  const size_t width = texture.width, height = texture.height;
  const bool squares = texture.interpolation != GLINT_CLOSEST;
  const auto row_of = [&](size_t j, std::vector<uint8_t>& row) {
    row.resize(width);
    for (size_t i = 0; i < width; ++i) row[i] = reading_of(texture, j * width + i, of_alpha);
    const uint8_t first = row[0];
    for (size_t i = 0; squares && i < width; ++i) {
      const size_t beside = next(i, width, texture.extension);
      row[i] &= beside == 0 ? first : row[beside];
    }
  };
  bits_.resize((width * height + 3) / 4);
  std::vector<uint8_t> here, above;
  row_of(0, here);
  for (size_t j = 0; j < height; ++j, here.swap(above)) {
    row_of(next(j, height, texture.extension), above);
    for (size_t i = 0, at = j * width; i < width; ++i, ++at)
      bits_[at / 4] |= uint8_t((squares ? here[i] & above[i] : here[i]) << at % 4 * 2);
  }
}

/// Places of the map, one or two; -1 where an image ends.
struct TexelMap::Span {
  int64_t first, last;
};

TexelMap::Span TexelMap::span(double x, double off, uint32_t size) const {
  const int extension = texture_.extension;
  const bool squares = texture_.interpolation != GLINT_CLOSEST;
  if (extension == GLINT_REPEAT) x -= double(down(x));
  if (extension == GLINT_MIRROR_EXTENSION) x -= 2 * double(down(0.5 * x));
  const double at = std::clamp(x, -2.0, 3.0) * size - (squares ? 0.5 : 0);
  const int64_t low = down(at - off), high = down(at + off);
  if (low >= 0 && high + 1 < int64_t(size)) return {low, high};
  const auto stored = [&](int64_t i) -> int64_t {
    const int64_t n = size, period = extension == GLINT_MIRROR_EXTENSION ? 2 * n : n;
    if (extension == GLINT_CLIP) return i >= 0 && i + squares < n ? i : -1;
    if (extension == GLINT_EXTEND) return std::clamp<int64_t>(i, 0, n - 1);
    while (i < 0) i += period;
    while (i >= period) i -= period;
    return i < n ? i : std::max<int64_t>(2 * n - 1 - squares - i, 0);
  };
  return {stored(low), stored(high)};
}

uint8_t TexelMap::around(const double (&at)[2], const double (&off)[2]) const {
  const Span x = span(at[0], off[0], texture_.width), y = span(at[1], off[1], texture_.height);
  if (x.first < 0 || x.last < 0 || y.first < 0 || y.last < 0) return kMixed;
  const auto read = [&](int64_t i, int64_t j) {
    const size_t k = size_t(j) * texture_.width + size_t(i);
    return bits_[k / 4] >> k % 4 * 2;
  };
  int all = read(x.first, y.first);
  if (x.last != x.first) all &= read(x.last, y.first);
  if (y.last != y.first) all &= read(x.first, y.last) & read(x.last, y.last);
  return all & 3;
}

OpacityMaps::OpacityMaps(const Scene& scene) : scene_(scene) {
  for (uint32_t m = 0; m < scene.materials.size(); ++m) known_.push_back(known(m));
  for (const GlintInstances& group : scene.instances.groups) add_looks(group);
  std::vector<uint8_t> of_groups;
  for (const Looks& group : of_group_) of_groups.push_back(of_group(group));
  for (const Placement& p : scene.instances.placements) of_instance_.push_back(of_groups[p.group]);
  view_.of_instance = of_instance_.data();
  view_.maps = this;
  view_.at = [](const void* maps, uint32_t instance, uint32_t primitive, double u, double v) {
    return static_cast<const OpacityMaps*>(maps)->at(instance, primitive, u, v);
  };
}

OpacityMaps::Known OpacityMaps::known(uint32_t m) {
  const Material& material = scene_.materials[m];
  Known found;
  if (!material.has(GLINT_TRANSPARENT)) {
    found.always = Opacity::kSolid;
    return found;
  }
  for (uint32_t l = material.first_lobe; l < material.first_lobe + material.lobe_count; ++l) {
    const LobeShape& lobe = scene_.materials.lobes[l];
    for (uint32_t i = lobe.first_input;
         lobe.kind == GLINT_TRANSPARENT && i < lobe.first_input + lobe.input_count; ++i) {
      const GlintInput& input = scene_.materials.inputs[i];
      if (input.texture < 0) continue;
      // a hole of a cubic image would take four texels in a row
      if (scene_.materials.textures[size_t(input.texture)].interpolation == GLINT_CUBIC) continue;
      found.at_zero = where(m, i, 0);
      found.at_one = where(m, i, 1);
      if (found.at_zero == Opacity::kVaried && found.at_one == Opacity::kVaried) continue;
      const bool of_alpha = input.channel == GLINT_ALPHA;
      found.map = &maps_
                       .try_emplace({input.texture, of_alpha},
                                    scene_.materials.textures[size_t(input.texture)], of_alpha)
                       .first->second;
      found.always = Opacity::kMapped;
      found.input = &input;
      return found;
    }
  }
  return found;
}

/// What a material is where the image of an input, and whatever looks at the same, reads so.
uint8_t OpacityMaps::where(uint32_t m, uint32_t input, double reading) const {
  const Material& material = scene_.materials[m];
  Vec3d passes;
  bool all = true, nothing_else = true;
  for (uint32_t l = material.first_lobe; l < material.first_lobe + material.lobe_count; ++l) {
    const LobeShape& lobe = scene_.materials.lobes[l];
    Vec3d k;
    const bool sure = product(lobe, input, reading, k);
    if (lobe.kind == GLINT_TRANSPARENT) {
      passes += k;
      all = all && sure;
    } else nothing_else = nothing_else && sure && !any(k);
  }
  if (all && nothing_else && !material.is_dense && passes.x == 1 && passes.y == 1 && passes.z == 1)
    return Opacity::kClear;
  return all && passes.x <= 0 && passes.y <= 0 && passes.z <= 0 ? Opacity::kSolid
                                                                : Opacity::kVaried;
}

/// A lobe's coefficient there; false where it depends on something else.
bool OpacityMaps::product(const LobeShape& lobe, uint32_t input, double reading, Vec3d& k) const {
  if (lobe.constant) {
    k = coefficient(lobe);
    return true;
  }
  bool all = true;
  k = {1, 1, 1};
  for (uint32_t i = lobe.first_input; i < lobe.first_input + lobe.input_count; ++i) {
    const GlintInput& in = scene_.materials.inputs[i];
    const bool read = in.texture >= 0 && same_read(in, scene_.materials.inputs[input]);
    const bool zero = read && reading == 0;
    if (!zero && (in.attribute >= 0 || in.output > 0 || (in.texture >= 0 && !read))) {
      all = false;
      continue;
    }
    const Vec3d factor = factor_of(in, zero ? 0 : 1);
    if (!any(factor)) {
      k = {};
      return true;
    }
    k = k * factor;
  }
  return all;
}

/// What is known of a material on the geometry of a group.
OpacityMaps::Look OpacityMaps::look(const GlintInstances& group, uint32_t material) const {
  Look found{known_[material]};
  Known& known = found.known;
  if (!known.input) return found;
  const GlintGeometry& geometry = scene_.instances.geometry(group);
  const GlintAttribute* a = scene_.instances.attributes.data() + geometry.first_attribute;
  const GlintAttribute* const end = a + geometry.attribute_count;
  a = std::find_if(a, end, [&](const GlintAttribute& b) {
    return known.input->uv < 0 ? b.channels == 2 : b.name == known.input->uv;
  });
  if (a == end || a->channels < 2 || a->domain == GLINT_FACE) {
    known.always = Opacity::kVaried;
    known.input = nullptr;
    return found;
  }
  found.rows = a->domain == GLINT_CORNER ? geometry.corners : geometry.triangles;
  found.values = a->values;
  found.channels = a->channels;
  return found;
}

void OpacityMaps::add_looks(const GlintInstances& group) {
  const uint16_t* const slots = scene_.instances.geometry(group).material_slots;
  const uint32_t first = uint32_t(looks_.size());
  for (uint32_t k = 0; k < group.material_count; ++k)
    looks_.push_back(look(group, scene_.instances.material_slots[group.first_material + k]));
  if (group.material_count == 0) looks_.push_back(look(group, uint32_t(known_.size() - 1)));
  const uint32_t last = uint32_t(looks_.size()) - 1;
  of_group_.push_back({last > first ? slots : nullptr, first, last});
}

/// What all of its instances are everywhere; kMapped where that depends on the place.
uint8_t OpacityMaps::of_group(const Looks& group) const {
  const uint8_t all = looks_[group.first].known.always;
  for (uint32_t k = group.first + 1; k <= group.last; ++k)
    if (looks_[k].known.always != all) return Opacity::kMapped;
  return all;
}

uint8_t OpacityMaps::at(uint32_t instance, uint32_t primitive, double u, double v) const {
  const Looks& group = of_group_[scene_.instances.placements[instance].group];
  const uint32_t slot = group.slots ? group.slots[primitive] : 0;
  const Look& look = looks_[std::min(group.first + slot, group.last)];
  const Known& known = look.known;
  if (!known.input) return known.always;
  const uint32_t* rows = look.rows + 3 * size_t(primitive);
  const double* m = known.input->uv_transform;
  double corner[3][2];
  for (int k = 0; k < 3; ++k) {
    const float* uv = look.values + look.channels * rows[k];
    for (int c = 0; c < 2; ++c)
      corner[k][c] = m[3 * c] * double(uv[0]) + m[3 * c + 1] * double(uv[1]) + m[3 * c + 2];
  }
  double at[2], off[2];
  for (int c = 0; c < 2; ++c) {
    const double q = corner[1][c] - corner[0][c], r = corner[2][c] - corner[0][c];
    at[c] = corner[0][c] + u * q + v * r;
    off[c] = kOff * (std::fabs(q) + std::fabs(r)) * known.map->size(c) + kOff;
    if (!(off[c] < kMostOff && std::fabs(at[c]) < kFarOut)) return Opacity::kVaried;
  }
  const uint8_t read = known.map->around(at, off);
  return read == TexelMap::kZero  ? known.at_zero
         : read == TexelMap::kOne ? known.at_one
                                  : uint8_t(Opacity::kVaried);
}

PassedInstances::PassedInstances(const InstanceTable& instances, const Opacity* opacity,
                                 uint64_t passed_sets, bool catchers_alone) {
  if (opacity) view_ = *opacity;
  of_instance_.resize(instances.placements.size());
  for (uint32_t i = 0; i < of_instance_.size(); ++i) {
    const GlintInstances& group = instances.group(i);
    const bool passed =
        passed_sets >> group.light_set & 1 || (catchers_alone && !(group.flags & GLINT_CATCHER));
    const uint8_t own = opacity ? opacity->of_instance[i] : uint8_t(Opacity::kSolid);
    of_instance_[i] = passed ? uint8_t(Opacity::kClear) : own;
  }
  view_.of_instance = of_instance_.data();
}

}  // namespace glint
