#include "scene/scene.h"

#include <chrono>
#include <cstring>
#include <numeric>

#include "integrator/first_hit_cache.h"
#include "math/math.h"
#include "scene/opacity_map.h"
#include "scene/panorama_step.h"
#include "scene/texture.h"

namespace glint {
namespace {

/// Object-space box of a geometry's finite points; spheres with their radii.
Extent extent_of(const GlintGeometry& geometry) {
  Extent box;
  for (uint64_t i = 0; i < geometry.vertex_count; ++i) {
    Vec3d p(Vec3f{geometry.vertices[3 * i], geometry.vertices[3 * i + 1],
                  geometry.vertices[3 * i + 2]});
    double r = geometry.radii ? geometry.radii[i] : 0;
    if (!finite(p) || !std::isfinite(r)) continue;
    box.grow(p - Vec3d{r, r, r});
    box.grow(p + Vec3d{r, r, r});
  }
  return box;
}

/// The largest distance from `origin` of the box's corners after m.
double reach(const Extent& box, const Affine& m, Vec3d origin) {
  double far = 0;
  for (int k = 0; k < 8; ++k) {
    far = std::max(far, max_abs(direction(m, box.corner(k)) + (m.t - origin)));
  }
  return far;
}

/// 2^-k for a radius in [2^k, 2^(k+1)); exponents beyond 200 would only make squares overflow.
double power_scale(double radius) {
  if (!(radius > 0 && radius < kInfinity)) return 1;
  return power_of_two(-std::clamp(std::ilogb(radius), -200, 200));
}

/// Of a matrix to anchored space; the group is the caller's to set.
InstanceShape shape_of(const Affine& m) {
  const NormalMatrix n(m);
  const Vec3d columns[7] = {m.x, m.y, m.z, m.t, n.x, n.y, n.z};
  InstanceShape shape{};
  for (int k = 0; k < 21; ++k) (k < 12 ? shape.m[k] : shape.normal[k - 12]) = columns[k / 3][k % 3];
  shape.mirrors = dot(m.x, cross(m.y, m.z)) < 0;
  return shape;
}

bool no_rank(const Affine& m) {
  NormalMatrix n(m);
  return !any(n.x) && !any(n.y) && !any(n.z);
}

bool sound(const GlintLight& g) {
  bool good = finite(affine(g.world_from_light)) && any(affine(g.world_from_light).z);
  for (double x : {g.color[0], g.color[1], g.color[2], g.strength, g.radius, g.angle, g.spot_size,
                   g.spot_blend, g.size_x, g.size_y})
    good = good && std::isfinite(x);
  return good;
}

template <class T, class U>
void copy(std::vector<T>& to, const U* from, uint64_t count) {
  to.reserve(count);
  for (uint64_t i = 0; i < count; ++i) to.emplace_back(from[i]);
}

Vec3d finite_color(const double* c) {
  auto channel = [](double x) { return std::isfinite(x) ? std::clamp(x, -1e100, 1e100) : 0; };
  return {channel(c[0]), channel(c[1]), channel(c[2])};
}

constexpr double kLeastStep = 3.0 / 1024;  // of a medium that varies: so rays take 1024 at most
constexpr size_t kFirstHitCaches = 2;      // a viewport shows a view and in it the render's frame
constexpr uint32_t kVisibility = kCamera | kMirror | kShadow;

}  // namespace

Scene::Scene(const GlintSceneData& data, const Scene* base, bool exact) : camera(data.camera) {
  copy_tables(data);
  compile_materials(data);
  if (base) reuse_from(*base, data, exact);
  const Vec3d eye = affine(camera.world_from_camera).t;
  const bool stays = earlier_.trees.accel && !exact && earlier_.anchor.near(eye);
  anchor.origin = stays ? earlier_.anchor.origin : eye;
  place_instances(base);
  anchor.scale = stays ? earlier_.anchor.scale : power_scale(radius(base));
  set_program_view();
  place_lights(data.lights, data.light_count);
  place_media(data);
  emitters.assign(data.emitters, data.emitters + data.emitter_count);
  emitter_corners_ = data.emitter_corners;
  note_features();
  shape_groups();
  shape_instances(base);
  fold_materials();
  count_passing();
  earlier_.trees.same_space = earlier_.trees.accel && anchor == earlier_.anchor;
  if (base) share_trees(*base, exact);
  if (base) share_emitters(*base);
}

Scene::~Scene() = default;

const Opacity* Scene::opacity() const { return opacity_ ? &opacity_->view() : nullptr; }

const Opacity* Scene::opacity(const Light& light) const {
  const PassedInstances* const passed = passed_[size_t(&light - lights.data())].get();
  return passed ? &passed->view() : opacity();
}

const Opacity* Scene::opacity_of_catchers(const Light& light) const {
  const PassedInstances* const own = caught_[size_t(&light - lights.data())].get();
  return &(own ? own : caught_.back().get())->view();
}

/// The trees that a later scene may take over: this one's, or as long as it has none those that it
/// would take over itself.
Scene::Earlier Scene::trees() const {
  std::lock_guard lock(build_mutex_);
  if (!accel_) return earlier_;
  Earlier mine{{accel_, std::vector<uint32_t>(geometries.size()), false, exact_}, anchor};
  std::iota(mine.trees.geometry.begin(), mine.trees.geometry.end(), 0u);
  return mine;
}

void Scene::reuse_from(const Scene& base, const GlintSceneData& data, bool exact) {
  earlier_ = base.trees();
  const std::vector<uint32_t> there = std::move(earlier_.trees.geometry);
  geometry_in_base_ = same_geometries(data, base);
  earlier_.trees.geometry = geometry_in_base_;
  for (uint32_t& g : earlier_.trees.geometry)
    if (g != AccelBase::kNone) g = there.empty() ? AccelBase::kNone : there[g];
  const auto none = [](uint32_t g) { return g == AccelBase::kNone; };
  if (std::all_of(earlier_.trees.geometry.begin(), earlier_.trees.geometry.end(), none))
    earlier_.trees = {};
  earlier_.trees.exact = exact;
}

/// Where the mesh lights are the same, so are their trees.
void Scene::share_emitters(const Scene& base) {
  const std::vector<const Light*> here = mesh_lights(), there = base.mesh_lights();
  const auto same = [](const Light* a, const Light* b) {
    return a->first_emitter == b->first_emitter && a->emitter_count == b->emitter_count &&
           std::memcmp(&a->placed, &b->placed, sizeof a->placed) == 0;
  };
  if (here.empty() || emitter_corners_ != base.emitter_corners_ ||
      emitters.size() != base.emitters.size() ||
      !std::equal(here.begin(), here.end(), there.begin(), there.end(), same))
    return;
  std::lock_guard lock(base.build_mutex_);
  emitter_accels_ = base.emitter_accels_;
  emitter_rows_ = base.emitter_rows_;
}

/// Where nothing stands elsewhere, the trees are those of `base`.
void Scene::share_trees(const Scene& base, bool exact) {
  if (!same_placements(base)) return;
  std::lock_guard lock(base.build_mutex_);
  if (!base.accel_ || (exact && !base.exact_)) return;
  accel_ = base.accel_;
  exact_ = base.exact_;
  earlier_ = {};
  const auto same = [](const GlintGeometry& a, const GlintGeometry& b) {
    return a.normals.values == b.normals.values && a.normals.domain == b.normals.domain &&
           a.corners == b.corners;
  };
  if (std::equal(geometries.begin(), geometries.end(), base.geometries.begin(),
                 base.geometries.end(), same))
    first_hit_caches_ = base.first_hit_caches_;
}

std::shared_ptr<FirstHitCache> Scene::first_hits(const RenderPlan& plan, const Film& film) {
  std::lock_guard lock(build_mutex_);
  const auto found = std::find_if(first_hit_caches_.begin(), first_hit_caches_.end(),
                                  [&](const auto& s) { return s->is_of(camera, plan); });
  if (found != first_hit_caches_.end()) std::rotate(first_hit_caches_.begin(), found, found + 1);
  else
    first_hit_caches_.insert(first_hit_caches_.begin(),
                             std::make_shared<FirstHitCache>(camera, plan, film));
  if (first_hit_caches_.size() > kFirstHitCaches) first_hit_caches_.pop_back();
  return first_hit_caches_.front();
}

void Scene::copy_tables(const GlintSceneData& data) {
  ambient = finite_color(data.ambient);
  background = finite_color(data.background);
  transparent_film = data.transparent != 0;
  aov_count = uint32_t(data.aov_count);
  light_group_count = uint32_t(data.light_group_count);
  world_light_group = data.world_light_group - 1;
  occlusion_distance = data.occlusion_distance;
  mist = {data.mist_start, data.mist_depth > 0 ? 1 / data.mist_depth : 0, data.mist_falloff};
  copy(geometries, data.geometries, data.geometry_count);
  copy(attributes, data.attributes, data.attribute_count);
  copy(groups, data.instances, data.instances_count);
  copy(material_slots, data.material_slots, data.material_slot_count);
  for (uint64_t i = 0; i < data.texture_count; ++i) textures.push_back(shape_of(data.textures[i]));
  copy_programs(data);
  copy(inputs, data.inputs, data.input_count);
  world_from_object = data.world_from_object;
  instance_values = {nullptr, data.instance_value_names, data.instance_values,
                     size_t(data.instance_value_count), size_t(data.row_count)};
}

/// Whether the instance with that number stands as in `base`, whose rows of matrices may be others.
bool Scene::stands(const Scene* base, size_t i) const {
  return base && i < base->placements.size() && anchor.same_origin(base->anchor) &&
         std::memcmp(matrix_row(placements[i].row), base->matrix_row(base->placements[i].row),
                     12 * sizeof(double)) == 0;
}

/// Numbers the instances, leaving out those whose matrix is not finite or squeezes everything to a
/// line.
void Scene::place_instances(const Scene* base) {
  placements.reserve(groups.size());
  for (uint32_t g = 0; g < groups.size(); ++g) {
    const GlintInstances& group = groups[g];
    const GlintGeometry& geometry = geometries[group.geometry];
    for (uint64_t row = group.first_row; row < group.first_row + group.row_count; ++row) {
      placements.push_back({uint32_t(row), g});
      const Affine m = affine(matrix_row(uint32_t(row)));
      const bool good = stands(base, placements.size() - 1) ||
                        (finite(m) && finite(m.t - anchor.origin) && !no_rank(m));
      if (!good) {
        placements.pop_back();
        ++dropped_instances;
        continue;
      }
      if (geometry.kind == GLINT_MESH) triangles += geometry.primitive_count;
    }
  }
  instance_values.placements = placements.data();
  for (const GlintGeometry& geometry : geometries) primitives += geometry.primitive_count;
}

void Scene::set_program_view() {
  const Affine m = affine(camera.world_from_camera);
  const Vec3d axes[3] = {m.x, m.y, m.z};
  ProgramView& view = program_view;
  for (int c = 0; c < 3; ++c) {
    view.origin[c] = anchor.origin[c];
    view.eye[c] = m.t[c];
    for (int k = 0; k < 3; ++k) view.axes[k][c] = axes[k][c];
  }
  view.scale = anchor.scale;
  view.parallel = camera.kind == GLINT_ORTHOGRAPHIC;
  view.clip_start = camera.clip_start;
  std::copy_n(camera.window, 4, view.window);
  view.panorama = camera.kind == GLINT_PANORAMA ? &camera : nullptr;
  view.step = 0.1 * length(m.x) * (camera.window[1] - camera.window[0]) / camera.width;
  if (view.panorama) view.step = panorama_step(camera);
}

double Scene::radius(const Scene* base) {
  for (uint32_t g = 0; g < geometries.size(); ++g) {
    const uint32_t there = base ? geometry_in_base_[g] : AccelBase::kNone;
    const bool known = there < (base ? base->extents_.size() : 0);
    extents_.push_back(known ? base->extents_[there] : extent_of(geometries[g]));
  }
  double far = 0;
  for (const Placement& p : placements) {
    const Extent& box = extents_[groups[p.group].geometry];
    if (!box.empty()) far = std::max(far, reach(box, affine(matrix_row(p.row)), anchor.origin));
  }
  return far;
}

bool Scene::same_placements(const Scene& base) const {
  if (!(anchor == base.anchor) || placements.size() != base.placements.size() ||
      geometries.size() != base.geometries.size())
    return false;
  for (size_t i = 0; i < placements.size(); ++i) {
    const GlintInstances &a = groups[placements[i].group],
                         &b = base.groups[base.placements[i].group];
    if (geometry_in_base_[a.geometry] != b.geometry || a.geometry != b.geometry ||
        ((a.flags ^ b.flags) & kVisibility))
      return false;
    if (!stands(&base, i)) return false;
  }
  return true;
}

void Scene::place_lights(const GlintLight* data, size_t count) {
  uint32_t mesh_number = 0;
  for (size_t i = 0; i < count; ++i) {
    if (!sound(data[i])) {
      ++dropped_lights;
    } else {
      lights.emplace_back(data[i], anchor, programs.data());
      lights.back().mesh_number = mesh_number;
    }
    mesh_number += data[i].kind == GLINT_MESH_LIGHT;
  }
}

void Scene::place_media(const GlintSceneData& data) {
  const auto per_length = [&](const double* c) { return (1 / anchor.scale) * finite_color(c); };
  for (uint64_t i = 0; i < data.medium_count; ++i) {
    const GlintMedium& g = data.media[i];
    Medium medium;
    medium.absorption = per_length(g.absorption);
    medium.scattering = per_length(g.scattering);
    medium.extinction = medium.absorption + medium.scattering;
    medium.emission = per_length(g.emission);
    medium.anisotropy = g.anisotropy;
    if (g.program > 0) medium.program = &programs[size_t(g.program - 1)];
    medium.absorption_slot = g.absorption_slot;
    medium.scattering_slot = g.scattering_slot;
    medium.emission_slot = g.emission_slot;
    medium.anisotropy_slot = g.anisotropy_slot;
    medium.step = g.step;
    media.push_back(medium);
    varies = varies || medium.program;
  }
  world_medium = data.world_medium - 1;
  for (int k = 0; k < 3; ++k) {
    Vec3d axis;
    axis[k] = anchor.scale;
    const Vec3d start = anchor.point(Vec3d{});
    for (int c = 0; c < 3; ++c) world_space.m[3 * k + c] = axis[c];
    world_space.m[9 + k] = start[k];
    world_space.normal[4 * k] = 1;
  }
  for (uint32_t i = 0; !media.empty() && i < placements.size(); ++i) {
    const GlintInstances& g = group(i);
    int32_t medium = 0;
    for (uint32_t k = 0; medium == 0 && k < g.material_count; ++k)
      medium = materials[material_slots[g.first_material + k]].medium;
    if (medium == 0 || geometry(g).kind == GLINT_STRANDS) continue;
    // The scene's radius is not asked for where it stays in an earlier one's space.
    const Extent box = extents_.empty() ? extent_of(geometry(g)) : extents_[g.geometry];
    if (box.empty()) continue;
    Extent placed;
    const Affine m = anchored(placements[i].row);
    for (int k = 0; k < 8; ++k) placed.grow(point(m, box.corner(k)));
    const Vec3d size = placed.high - placed.low;
    const double side = (size.x + size.y + size.z) / 3,
                 step = std::max(media[size_t(medium - 1)].step, kLeastStep) * side;
    enclosures.push_back({i, uint32_t(medium - 1), placed.low, placed.high, step});
  }
  for (const Medium& medium : media) {
    scatters = scatters || medium.scatters();
    emits = emits || medium.emits();
  }
}

void Scene::note_features() {
  // Shadows have colours where media dim light.
  if (world_medium >= 0 || !enclosures.empty())
    features |=
        GLINT_FEATURE_MEDIA | GLINT_FEATURE_TRANSPARENT | (varies ? GLINT_FEATURE_VARIED_MEDIA : 0);
  for (const GlintInstances& group : groups) {
    if (group.flags & GLINT_HOLDOUT) features |= GLINT_FEATURE_HOLDOUT;
    if (group.flags & GLINT_CATCHER) features |= GLINT_FEATURE_SHADOW_CATCHER;
    if (geometries[group.geometry].normals.values) features |= GLINT_FEATURE_SMOOTH_NORMALS;
    for (uint32_t k = 0; k < group.material_count; ++k) {
      const Material& material = materials[material_slots[group.first_material + k]];
      if (material.has(GLINT_MIRROR)) features |= GLINT_FEATURE_MIRROR;
      if (material.has(GLINT_REFRACTION)) features |= GLINT_FEATURE_REFRACTION;
      if (material.has(GLINT_TRANSPARENT)) features |= GLINT_FEATURE_TRANSPARENT;
    }
  }
  for (const Light& light : lights) {
    if (light.is_dome()) features |= GLINT_FEATURE_WORLD_LIGHT;
    else if (light.is_mesh()) features |= GLINT_FEATURE_MESH_LIGHT;
    else if (light.is_bounced()) features |= GLINT_FEATURE_BOUNCED_LIGHT;
    else if (light.extended) features |= GLINT_FEATURE_SOFT_LIGHTS;
    if (light.flags & (GLINT_SEEN_BY_CAMERA | GLINT_SEEN_BY_MIRROR) && any(light.seen))
      features |= GLINT_FEATURE_VISIBLE_LIGHTS;
  }
  if (!programs.empty()) features |= GLINT_FEATURE_NODE_PROGRAMS;
  if (!textures.empty()) features |= GLINT_FEATURE_TEXTURES;
}

uint32_t Scene::material_of(const GlintInstances& group, uint32_t primitive) const {
  if (group.material_count == 0) return uint32_t(materials.size() - 1);
  const uint16_t* slots = geometries[group.geometry].material_slots;
  uint32_t slot = slots ? slots[primitive] : 0;
  return material_slots[group.first_material + std::min(slot, group.material_count - 1)];
}

void Scene::shape_groups() {
  group_shapes.reserve(groups.size());
  for (const GlintInstances& group : groups) {
    const GlintGeometry& g = geometries[group.geometry];
    GroupShape shape{};
    if (g.kind == GLINT_MESH) {
      shape.vertices = g.vertices;
      shape.triangles = g.triangles;
      shape.normals = g.normals.values;
    }
    shape.normal_rows = g.normals.domain == GLINT_CORNER ? g.corners : g.triangles;
    shape.material = group.material_count > 0 ? material_slots[group.first_material]
                                              : uint32_t(materials.size() - 1);
    if (group.flags & GLINT_HOLDOUT) shape.material = holdout();
    if (g.material_slots && group.material_count > 1 && !(group.flags & GLINT_HOLDOUT)) {
      shape.slots = g.material_slots;
      shape.materials = material_slots.data() + group.first_material;
    }
    shape.material_count = group.material_count;
    only_meshes = only_meshes && g.kind == GLINT_MESH;
    group_shapes.push_back(shape);
  }
}

void Scene::shape_instances(const Scene* base) {
  instance_shapes.reserve(placements.size());
  const Scene* alike = base && anchor == base->anchor ? base : nullptr;
  for (size_t i = 0; i < placements.size(); ++i) {
    instance_shapes.push_back(stands(alike, i) ? base->instance_shapes[i]
                                               : shape_of(anchored(placements[i].row)));
    instance_shapes.back().group = placements[i].group;
  }
}

Affine Scene::matrix(uint32_t instance) const {
  const double* m = instance_shapes[instance].m;
  return {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}, {m[9], m[10], m[11]}};
}

NormalMatrix Scene::normal_matrix(uint32_t instance) const {
  const double* n = instance_shapes[instance].normal;
  return {{n[0], n[1], n[2]}, {n[3], n[4], n[5]}, {n[6], n[7], n[8]}};
}

std::vector<GeometryView> Scene::geometry_views() const {
  std::vector<GeometryView> views;
  for (const GlintGeometry& g : geometries)
    views.push_back({GeometryView::Kind(g.kind), g.vertices, g.vertex_count, g.triangles, g.radii,
                     g.offsets, g.indices, g.primitive_count});
  return views;
}

std::vector<InstanceView> Scene::instance_views() const {
  static_assert(kCamera == uint32_t(GLINT_VISIBLE_CAMERA) &&
                kMirror == uint32_t(GLINT_VISIBLE_MIRROR));
  static_assert(kShadow == uint32_t(GLINT_VISIBLE_SHADOW));
  std::vector<InstanceView> views;
  views.reserve(placements.size());
  for (const Placement& p : placements) {
    const GlintInstances& group = groups[p.group];
    views.push_back({group.geometry, group.flags & kVisibility, anchored(p.row)});
  }
  return views;
}

std::vector<const Light*> Scene::mesh_lights() const {
  std::vector<const Light*> found;
  for (const Light& light : lights)
    if (light.is_mesh()) found.push_back(&light);
  return found;
}

/// Of the mesh lights, if there are any.
bool Scene::build_emitters(int threads, const std::atomic<bool>& cancel) {
  const std::vector<const Light*> found = mesh_lights();
  if (found.empty() || !emitter_accels_.empty()) return true;
  std::vector<uint32_t> rows(3 * emitters.size());
  std::iota(rows.begin(), rows.end(), 0u);
  emitter_rows_ = std::make_shared<const std::vector<uint32_t>>(std::move(rows));
  std::vector<std::shared_ptr<const Accel>> trees(found.back()->mesh_number + 1);
  for (const Light* light : found) {
    const GeometryView view{GeometryView::kMesh,
                            emitter_corners_ + 9 * light->first_emitter,
                            3 * light->emitter_count,
                            emitter_rows_->data(),
                            nullptr,
                            nullptr,
                            nullptr,
                            light->emitter_count};
    auto& tree = trees[light->mesh_number];
    tree = Accel::build({view}, {{0, kVisibility, light->placed}}, threads, cancel);
    if (!tree) return false;
  }
  emitter_accels_ = std::move(trees);
  return true;
}

/// Of what encloses media, if anything does.
bool Scene::build_media(int threads, const std::atomic<bool>& cancel) {
  if (enclosures.empty() || media_accel_) return true;
  const std::vector<GeometryView> all = geometry_views();
  const std::vector<InstanceView> every = instance_views();
  std::vector<GeometryView> views;
  std::vector<InstanceView> instances;
  std::vector<uint32_t> number(all.size(), AccelBase::kNone);
  for (const Enclosure& e : enclosures) {
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

bool Scene::build(int threads, BuildQuality quality, const std::atomic<bool>& cancel) {
  std::lock_guard lock(build_mutex_);
  if (!opacity_ && features & GLINT_FEATURE_TRANSPARENT)
    opacity_ = std::make_unique<const OpacityMaps>(*this);
  if (passed_.empty()) {
    passed_.resize(lights.size());
    for (size_t k = 0; k < lights.size(); ++k)
      if (lights[k].casts_shadow() && lights[k].passed_sets)
        passed_[k] = std::make_unique<const PassedInstances>(*this, lights[k].passed_sets, false);
  }
  if (caught_.empty() && features & GLINT_FEATURE_SHADOW_CATCHER) {
    for (const Light& light : lights)
      caught_.push_back(light.passed_sets ? std::make_unique<const PassedInstances>(
                                                *this, light.passed_sets, true)
                                          : nullptr);
    caught_.push_back(std::make_unique<const PassedInstances>(*this, 0, true));
  }
  if (!build_emitters(threads, cancel) || !build_media(threads, cancel)) return false;
  if (accel_) return true;
  auto start = std::chrono::steady_clock::now();
  accel_ =
      Accel::build(geometry_views(), instance_views(), threads, cancel, quality, earlier_.trees);
  if (accel_) {
    exact_ = !earlier_.trees.accel || earlier_.trees.exact;
    earlier_ = {};
  }
  build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return accel_ != nullptr;
}

}  // namespace glint
