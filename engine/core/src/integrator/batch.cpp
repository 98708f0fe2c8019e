#include "integrator/batch.h"

#include <algorithm>

namespace glint {
namespace {

constexpr size_t kFixed = 1 + 3 + 3 + 3 + 2 + 3 + 3;  // t, x, g, offset and weights, diffuse, total
constexpr size_t kSmooth = 3 + 3;                     // n, origin
constexpr size_t kBumps = 3 + 1;                      // unbent, bump
constexpr size_t kBehind = 3 + 3 + 3 + 1;             // translucent, behind, lifted, lifted_bump
constexpr size_t kBelow = 3 + 3;                      // below, radius
constexpr size_t kParts = 6 * 3, kSplit = 3 * 3;

size_t group_columns_of(const Scene& scene, Passes passes) {
  return passes >> GLINT_PASS_LIGHT_GROUPS & 1 ? 3 * size_t(scene.light_group_count) : 0;
}

}  // namespace

Batch::Batch(const Scene& scene, Passes passes, bool splits)
    : scene_(scene),
      passes_(passes),
      smooth_((scene.features & GLINT_FEATURE_SMOOTH_NORMALS) || scene.materials.bends_normals),
      splits_(splits),
      columns_(kFixed + (smooth_ ? kSmooth : 0) + size_t(scene.materials.rows_of_lobes.columns) +
               size_t(scene.materials.passing_columns * scene.materials.max_passing) +
               (scene.materials.shadows_bumps ? kBumps : 0) +
               (scene.instances.grazing_differs ? 1 : 0) + (scene.instances.lowers_light ? 1 : 0) +
               (scene.materials.has_translucent ? kBehind : 0) +
               (scene.materials.has_subsurface ? kBelow : 0) + kParts + (splits_ ? kSplit : 0) + 3 +
               group_columns_of(scene, passes)),
      groups_(group_columns_of(scene, passes)),
      given_(groups_.size() / 3) {}

void Batch::begin(const Queue& rays) {
  queue = &rays;
  count_ = rays.size();
  if (count_ > columns_.rows() || !t) reserve(count_);
  for (double* const* columns : {unbent, translucent, below})
    for (size_t c = 0; columns[0] && c < 3; ++c) std::fill_n(columns[c], count_, 0.0);
  bool primary = rays.visibility == kCamera;
  SumColumns only_total{};
  for (int c = 0; c < 3; ++c) {
    only_total.total[c] = parts_.total[c];
    if (has_groups()) only_total.ambient[c] = parts_.ambient[c];
    if (!splits_ && !has_groups()) continue;
    only_total.emission[c] = parts_.emission[c];
    only_total.environment[c] = parts_.environment[c];
    if (!splits_) continue;
    for (double* column : {lit_diffuse[c], lit_specular[c], lit_volume[c]})
      std::fill_n(column, primary ? count_ : 0, 0.0);
  }
  std::fill(given_.begin(), given_.end(), uint8_t(0));
  sums = primary ? parts_ : only_total;
}

void Batch::clear_group(size_t group) const {
  for (size_t c = 0; c < 3; ++c) std::fill_n(groups_[3 * group + c], count_, 0.0);
  given_[group] = 1;
}

void Batch::reserve(size_t rows) {
  columns_.reserve(rows);
  rows = columns_.rows();
  instance.resize(rows);
  primitive.resize(rows);
  material.resize(rows);
  others.resize(rows);
  passing_rows.resize(rows);
  u.resize(rows);
  v.resize(rows);
  lit.resize(rows);
  outside.resize(rows);
  if (passes_ >> GLINT_PASS_FALLBACKS & 1) fallbacks_.resize(rows);
  place_columns();
}

void Batch::place_columns() {
  size_t next = 0;
  auto one = [&] { return columns_[next++]; };
  auto three = [&](double*(&to)[3]) {
    to[0] = one();
    to[1] = one();
    to[2] = one();
  };
  auto part = [&](double*(&to)[3], int pass) {
    if (splits_ || has_groups() || passes_ >> pass & 1) three(to);
  };
  t = one();
  three(points.x);
  three(points.g);
  points.offset = one();
  points.weights[0] = one();
  points.weights[1] = one();
  for (int c = 0; c < 3; ++c) {
    points.n[c] = points.g[c];
    points.origin[c] = points.x[c];
  }
  if (smooth_) {
    three(points.n);
    three(points.origin);
  }
  if (scene_.materials.shadows_bumps) {
    three(unbent);
    bump = one();
  }
  if (scene_.instances.grazing_differs) grazing = one();
  if (scene_.instances.lowers_light) lowering = one();
  if (scene_.materials.has_translucent) {
    three(translucent);
    if (smooth_) three(points.behind);
    if (scene_.materials.shadows_bumps) {
      three(lifted);
      lifted_bump = one();
    }
  }
  if (scene_.materials.has_subsurface) {
    three(below);
    three(radius);
  }
  points.outside = outside.data();
  points.material = material.data();
  three(diffuse);
  three(parts_.total);
  part(parts_.ambient, GLINT_PASS_AMBIENT);
  part(parts_.emission, GLINT_PASS_EMISSION);
  part(parts_.environment, GLINT_PASS_ENVIRONMENT);
  bool light_parts =
      splits_ || passes_ & (pass_bit(GLINT_PASS_DIFFUSE) | pass_bit(GLINT_PASS_SPECULAR) |
                            pass_bit(GLINT_PASS_SHADOW));
  if (light_parts) {
    three(parts_.diffuse);
    three(parts_.specular);
    three(parts_.shadow);
  }
  for (auto* to : {&lit_diffuse, &lit_specular, &lit_volume})
    if (splits_) three(*to);
  if (has_groups()) three(glow);
  for (double*& column : groups_) column = one();
  const size_t of_lobes = size_t(scene_.materials.rows_of_lobes.columns);
  specular = of_lobes > 0 ? columns_[next] : nullptr;
  next += of_lobes;
  passing_columns = scene_.materials.max_passing > 0 ? columns_[next] : nullptr;
  passing_width = scene_.materials.passing_columns;
  stride = columns_.rows();
}

Surface Batch::surface(size_t k) const {
  Surface s;
  s.instance = instance[k];
  s.primitive = primitive[k];
  s.outside = outside[k] != 0;
  s.weights[1] = points.weights[0][k];
  s.weights[2] = points.weights[1][k];
  s.weights[0] = 1 - s.weights[1] - s.weights[2];
  s.x = row(points.x, k);
  s.g = row(points.g, k);
  s.n = row(points.n, k);
  s.offset = points.offset[k];
  return s;
}

void Batch::set_surface(size_t k, const Surface& s) {
  set_row(points.x, k, s.x);
  set_row(points.g, k, s.g);
  points.offset[k] = s.offset;
  outside[k] = s.outside ? -1 : 0;
  points.weights[0][k] = s.weights[1];
  points.weights[1][k] = s.weights[2];
  if (smooth_) {
    set_row(points.n, k, s.n);
    set_row(points.origin, k, s.x);
    if (points.behind[0]) set_row(points.behind, k, s.x);
  }
}

void Batch::find_points(const Stages& stages, uint32_t missed) {
  SurfaceStage stage{};
  stage.count = count_;
  stage.points = points;
  static_cast<RayColumns&>(stage) = queue->columns();
  stage.instance = instance.data();
  stage.primitive = primitive.data();
  stage.u = u.data();
  stage.v = v.data();
  stage.instances = scene_.instances.shapes.data();
  stage.groups = scene_.instances.group_shapes.data();
  stage.missed = missed;
  stages.surface(stage);
  for (size_t k = 0; !scene_.instances.only_meshes && k < count_; ++k) {
    if (material[k] != kNoMaterial) continue;
    const Path path = queue->path(k);
    set_surface(k, surface_at(scene_, path.start, queue->ray(k).d, hit(k)));
    material[k] = scene_.instances.material_of(scene_.instances.group(instance[k]), primitive[k]);
  }
  set_offsets();
}

ShadeStage Batch::shading() {
  const MaterialTable& all = scene_.materials;
  ShadeStage stage{};
  static_cast<RayColumns&>(stage) = queue->columns();
  stage.lowering = lowering;
  stage.count = count_;
  stage.material = material.data();
  stage.terms = (queue->past.reflections > 0 ? all.reflected_terms : all.terms).data();
  stage.specular_terms = all.specular_terms.data();
  stage.specular_columns = size_t(all.rows_of_lobes.columns);
  stage.rows = all.spans.data();
  stage.row_count = all.other_count() + size_t(highlights());
  stage.lobes = &all.rows_of_lobes;
  stage.highlights = highlights();
  stage.sums = sums;
  stage.view_terms = all.view_terms.data();
  stage.max_view = all.max_view;
  for (size_t c = 0; c < 3; ++c) {
    stage.n[c] = points.n[c];
    stage.ambient[c] = scene_.world.ambient[int(c)];
    stage.diffuse[c] = diffuse[c];
  }
  stage.specular = specular;
  stage.stride = stride;
  stage.lit = lit.data();
  stage.others = others.data();
  return stage;
}

EvaluateStage Batch::evaluation(const Material& of, double* slots) {
  EvaluateStage stage{};
  static_cast<RayColumns&>(stage) = queue->columns();
  stage.tables = scene_.input_tables();
  stage.instance = instance.data();
  stage.primitive = primitive.data();
  stage.lobes = scene_.materials.lobes.data() + of.first_lobe;
  stage.lobe_count = of.lobe_count;
  stage.sums = sums;
  for (size_t c = 0; c < 3; ++c) {
    stage.diffuse[c] = diffuse[c];
    stage.translucent[c] = of.has(GLINT_TRANSLUCENT) ? translucent[c] : nullptr;
    stage.lifted[c] = lifted[c];
    stage.ambient[c] = scene_.world.ambient[int(c)];
    stage.n[c] = points.n[c];
    if (c < 2) stage.weights[c] = points.weights[c];
    stage.x[c] = points.x[c];
    stage.g[c] = points.g[c];
    stage.bent[c] = points.n[c];
    stage.unbent[c] = unbent[c];
  }
  for (size_t c = 0; of.goes_below && c < 3; ++c) {
    stage.below[c] = below[c];
    stage.radius[c] = radius[c];
  }
  stage.lifted_bump = lifted_bump;
  stage.lowering = lowering;
  stage.outside = points.outside;
  if (of.program > 0) {
    stage.program = scene_.programs.of(of.program);
    stage.normal = of.normal;
    stage.bump_shadowing = of.bump_shadowing;
    stage.base_normal = of.base_normal;
    stage.bump = bump;
    stage.kind = queue->visibility == kCamera ? RayKind::kCamera : RayKind::kBounced;
    stage.slots = slots;
    stage.offset = points.offset;
  }
  stage.layout = &scene_.materials.rows_of_lobes;
  stage.specular = specular;
  stage.passing = passing_columns;
  stage.passing_columns = passing_width;
  stage.stride = stride;
  stage.lit = lit.data();
  stage.passing_rows = passing_rows.data();
  return stage;
}

void Batch::set_offsets() {
  static constexpr GlintInstances kNothing{};
  for (size_t k = 0; (grazing || lowering) && k < count_; ++k) {
    const GlintInstances& group = missed(k) ? kNothing : scene_.instances.group(instance[k]);
    if (grazing) grazing[k] = group.geometry_offset > 0 ? 1 / group.geometry_offset : 0;
    if (lowering) lowering[k] = 1 / (1 - 0.5 * group.shading_offset);
  }
}

void Batch::clear_specular() {
  for (const LobeSpan& row : scene_.materials.spans)
    for (size_t c = 0; c < 3; ++c) std::fill_n(specular + (row.first + c) * stride, count_, 0.0);
}

bool Batch::turn_round() {
  bool some = false;
  for (size_t k = 0; k < count_; ++k) {
    lit[k] = any(row(translucent, k)) ? -1 : 0;
    some |= lit[k] != 0;
  }
  if (!some) return false;
  if (lifted[0])
    for (size_t k = 0; k < count_; ++k) {
      if (!lit[k]) continue;
      set_row(points.n, k, row(lifted, k));
      bump[k] = lifted_bump[k];
    }
  if (lowering) std::fill_n(lowering, count_, 1.0);
  for (double* const* columns : {points.g, smooth_ ? points.n : nullptr, unbent})
    for (size_t c = 0; columns && columns[0] && c < 3; ++c)
      for (size_t k = 0; k < count_; ++k) columns[c][k] = -columns[c][k];
  for (size_t c = 0; c < 3; ++c) {
    if (smooth_) std::copy_n(points.behind[c], count_, points.origin[c]);
    std::copy_n(translucent[c], count_, diffuse[c]);
  }
  clear_specular();
  return true;
}

}  // namespace glint
