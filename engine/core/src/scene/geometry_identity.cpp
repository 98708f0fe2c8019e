// What two scenes have in common: the same arrays at the same addresses.
#include <cstring>
#include <unordered_map>

#include "scene/scene.h"

namespace glint {
namespace {

bool same_arrays(const GlintGeometry& a, const GlintGeometry& b) {
  return a.kind == b.kind && a.vertices == b.vertices && a.triangles == b.triangles &&
         a.radii == b.radii && a.offsets == b.offsets && a.indices == b.indices &&
         a.vertex_count == b.vertex_count && a.primitive_count == b.primitive_count &&
         a.index_count == b.index_count;
}

bool same(const GlintAttribute& a, const GlintAttribute& b) {
  return a.values == b.values && a.rows == b.rows && a.domain == b.domain &&
         a.channels == b.channels;
}

/// Finds geometries by where their vertices are.
class Finder {
 public:
  explicit Finder(const Scene& scene) : scene_(scene) {}
  uint32_t find(const GlintGeometry& g, uint32_t guess) {
    if (guess < scene_.instances.geometries.size() &&
        same_arrays(g, scene_.instances.geometries[guess]))
      return guess;
    if (numbers_.empty())
      for (uint32_t k = 0; k < scene_.instances.geometries.size(); ++k)
        numbers_.emplace(scene_.instances.geometries[k].vertices, k);
    const auto found = numbers_.find(g.vertices);
    return found != numbers_.end() && same_arrays(g, scene_.instances.geometries[found->second])
               ? found->second
               : AccelBase::kNone;
  }

 private:
  const Scene& scene_;
  std::unordered_map<const float*, uint32_t> numbers_;
};

}  // namespace

std::vector<uint32_t> same_geometries(const GlintSceneData& data, const Scene& base) {
  Finder finder(base);
  std::vector<uint32_t> there(data.geometry_count);
  for (uint32_t g = 0; g < data.geometry_count; ++g) there[g] = finder.find(data.geometries[g], g);
  return there;
}

bool same_attributes(const GlintSceneData& data, const GlintGeometry& g, const Scene& base,
                     const GlintGeometry& there) {
  const bool counted = g.attribute_count == there.attribute_count &&
                       g.first_attribute <= data.attribute_count &&
                       g.attribute_count <= data.attribute_count - g.first_attribute;
  if (!counted || g.corners != there.corners || !same(g.normals, there.normals)) return false;
  for (uint32_t k = 0; k < g.attribute_count; ++k)
    if (!same(data.attributes[g.first_attribute + k],
              base.instances.attributes[there.first_attribute + k]))
      return false;
  return true;
}

}  // namespace glint
