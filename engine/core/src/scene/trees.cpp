#include "scene/trees.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <numeric>

#include "scene/opacity_map.h"
#include "scene/scene.h"

namespace glint {
namespace {

std::vector<InstanceView> instance_views(const InstanceTable& t, const Anchor& anchor) {
  static_assert(kCamera == uint32_t(GLINT_VISIBLE_CAMERA) &&
                kMirror == uint32_t(GLINT_VISIBLE_MIRROR));
  static_assert(kShadow == uint32_t(GLINT_VISIBLE_SHADOW) &&
                kTransmission == uint32_t(GLINT_VISIBLE_TRANSMISSION) &&
                kDiffuse == uint32_t(GLINT_VISIBLE_DIFFUSE));
  std::vector<InstanceView> views;
  views.reserve(t.placements.size());
  for (const Placement& p : t.placements) {
    const GlintInstances& group = t.groups[p.group];
    views.push_back(
        {group.geometry, group.flags & kAnyRay, anchor.matrix(affine(t.matrix_row(p.row)))});
  }
  return views;
}

bool same_placements(const Scene& a, const Scene& b, const std::vector<uint32_t>& geometry_there) {
  const InstanceTable &here = a.instances, &there = b.instances;
  if (!(a.anchor == b.anchor) || here.placements.size() != there.placements.size() ||
      here.geometries.size() != there.geometries.size())
    return false;
  for (uint32_t i = 0; i < here.placements.size(); ++i) {
    const GlintInstances &g = here.group(i), &h = there.group(i);
    if (geometry_there[g.geometry] != h.geometry || g.geometry != h.geometry ||
        ((g.flags ^ h.flags) & kAnyRay))
      return false;
    if (!stands(here, there, i)) return false;
  }
  return true;
}

std::vector<const Light*> mesh_lights(const LightTable& lights) {
  std::vector<const Light*> found;
  for (const Light& light : lights)
    if (light.is_mesh()) found.push_back(&light);
  return found;
}

}  // namespace

std::vector<GeometryView> geometry_views(const GlintGeometry* geometries, size_t count) {
  std::vector<GeometryView> views;
  views.reserve(count);
  for (const GlintGeometry* g = geometries; g != geometries + count; ++g)
    views.push_back({GeometryView::Kind(g->kind), g->vertices, g->vertex_count, g->triangles,
                     g->radii, g->offsets, g->indices, g->primitive_count});
  return views;
}

SceneTrees::SceneTrees() = default;
SceneTrees::~SceneTrees() = default;

const Opacity* SceneTrees::opacity() const { return opacity_ ? &opacity_->view() : nullptr; }

const Opacity* SceneTrees::opacity(const Light& light) const {
  const PassedInstances* const passed = passed_[light.number].get();
  return passed ? &passed->view() : opacity();
}

const Opacity* SceneTrees::opacity_of_catchers(const Light& light) const {
  const PassedInstances* const own = caught_[light.number].get();
  return own ? &own->view() : opacity_of_catchers();
}

const Opacity* SceneTrees::opacity_of_catchers() const { return &caught_.back()->view(); }

/// The trees that a later scene may take over: these, or as long as there are none those that this
/// scene would take over itself.
SceneTrees::Earlier SceneTrees::at_hand(size_t geometry_count, const Anchor& anchor) const {
  std::lock_guard lock(mutex_);
  if (!accel_) return earlier_;
  Earlier mine{{accel_, std::vector<uint32_t>(geometry_count), false, exact_}, anchor};
  std::iota(mine.trees.geometry.begin(), mine.trees.geometry.end(), 0u);
  return mine;
}

void SceneTrees::begin_like(const Scene& base, const std::vector<uint32_t>& geometry_there,
                            bool exact) {
  earlier_ = base.trees.at_hand(base.instances.geometries.size(), base.anchor);
  const std::vector<uint32_t> there = std::move(earlier_.trees.geometry);
  earlier_.trees.geometry = geometry_there;
  for (uint32_t& g : earlier_.trees.geometry)
    if (g != AccelBase::kNone) g = there.empty() ? AccelBase::kNone : there[g];
  const auto none = [](uint32_t g) { return g == AccelBase::kNone; };
  if (std::all_of(earlier_.trees.geometry.begin(), earlier_.trees.geometry.end(), none))
    earlier_.trees = {};
  earlier_.trees.exact = exact;
}

bool SceneTrees::share(const Scene& scene, const Scene& base,
                       const std::vector<uint32_t>& geometry_there, bool exact) {
  earlier_.trees.same_space = earlier_.trees.accel && scene.anchor == earlier_.anchor;
  share_emitters(scene.lights, base);
  if (!same_placements(scene, base, geometry_there)) return false;
  std::lock_guard lock(base.trees.mutex_);
  if (!base.trees.accel_ || (exact && !base.trees.exact_)) return false;
  accel_ = base.trees.accel_;
  exact_ = base.trees.exact_;
  earlier_ = {};
  return true;
}

/// Where the mesh lights are the same, so are their trees.
void SceneTrees::share_emitters(const LightTable& lights, const Scene& base) {
  const std::vector<const Light*> here = mesh_lights(lights), there = mesh_lights(base.lights);
  const auto same = [](const Light* a, const Light* b) {
    return a->first_emitter == b->first_emitter && a->emitter_count == b->emitter_count &&
           std::memcmp(&a->placed, &b->placed, sizeof a->placed) == 0;
  };
  if (here.empty() || lights.emitter_corners != base.lights.emitter_corners ||
      lights.emitters.size() != base.lights.emitters.size() ||
      !std::equal(here.begin(), here.end(), there.begin(), there.end(), same))
    return;
  std::lock_guard lock(base.trees.mutex_);
  emitter_accels_ = base.trees.emitter_accels_;
  emitter_rows_ = base.trees.emitter_rows_;
}

/// Of the mesh lights, if there are any.
bool SceneTrees::build_emitters(const LightTable& lights, int threads,
                                const std::atomic<bool>& cancel) {
  const std::vector<const Light*> found = mesh_lights(lights);
  if (found.empty() || !emitter_accels_.empty()) return true;
  std::vector<uint32_t> rows(3 * lights.emitters.size());
  std::iota(rows.begin(), rows.end(), 0u);
  emitter_rows_ = std::make_shared<const std::vector<uint32_t>>(std::move(rows));
  std::vector<std::shared_ptr<const Accel>> trees(found.back()->table_number + 1);
  for (const Light* light : found) {
    const GeometryView view{GeometryView::kMesh,
                            lights.emitter_corners + 9 * light->first_emitter,
                            3 * light->emitter_count,
                            emitter_rows_->data(),
                            nullptr,
                            nullptr,
                            nullptr,
                            light->emitter_count};
    auto& tree = trees[light->table_number];
    tree = Accel::build({view}, {{0, kAnyRay, light->placed}}, threads, cancel);
    if (!tree) return false;
  }
  emitter_accels_ = std::move(trees);
  return true;
}

/// Of what encloses media, if anything does.
bool SceneTrees::build_media(const Scene& scene, int threads, const std::atomic<bool>& cancel) {
  if (scene.media.enclosures.empty() || media_accel_) return true;
  const std::vector<GeometryView> all =
      geometry_views(scene.instances.geometries.data(), scene.instances.geometries.size());
  const std::vector<InstanceView> every = instance_views(scene.instances, scene.anchor);
  std::vector<GeometryView> views;
  std::vector<InstanceView> instances;
  std::vector<uint32_t> number(all.size(), AccelBase::kNone);
  for (const Enclosure& e : scene.media.enclosures) {
    instances.push_back(every[e.instance]);
    uint32_t& geometry = number[instances.back().geometry];
    if (geometry == AccelBase::kNone) {
      geometry = uint32_t(views.size());
      views.push_back(all[instances.back().geometry]);
    }
    instances.back().geometry = geometry;
  }
  media_accel_ = Accel::build(std::move(views), std::move(instances), threads, cancel);
  return media_accel_ != nullptr;
}

void SceneTrees::find_opacity(const Scene& scene) {
  if (!opacity_ && scene.features & GLINT_FEATURE_TRANSPARENT)
    opacity_ = std::make_unique<const OpacityMaps>(scene);
  const auto passed = [&](uint64_t sets, bool all_but_catchers) {
    return std::make_unique<const PassedInstances>(scene.instances, opacity(), sets,
                                                   all_but_catchers);
  };
  if (passed_.empty())
    for (const Light& light : scene.lights)
      passed_.push_back(light.casts_shadow() && light.passed_sets ? passed(light.passed_sets, false)
                                                                  : nullptr);
  if (!caught_.empty() || !(scene.features & GLINT_FEATURE_SHADOW_CATCHER)) return;
  for (const Light& light : scene.lights)
    caught_.push_back(light.passed_sets ? passed(light.passed_sets, true) : nullptr);
  caught_.push_back(passed(0, true));
}

bool SceneTrees::build(const Scene& scene, int threads, BuildQuality quality,
                       const std::atomic<bool>& cancel) {
  std::lock_guard lock(mutex_);
  find_opacity(scene);
  if (!build_emitters(scene.lights, threads, cancel) || !build_media(scene, threads, cancel))
    return false;
  if (accel_) return true;
  const auto start = std::chrono::steady_clock::now();
  accel_ = Accel::build(
      geometry_views(scene.instances.geometries.data(), scene.instances.geometries.size()),
      instance_views(scene.instances, scene.anchor), threads, cancel, quality, earlier_.trees);
  if (accel_) {
    exact_ = !earlier_.trees.accel || earlier_.trees.exact;
    earlier_ = {};
  }
  build_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return accel_ != nullptr;
}

}  // namespace glint
