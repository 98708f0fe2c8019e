#include "integrator/batch.h"

#include <algorithm>

namespace glint {
Batch::Batch(const Scene& scene, Passes passes, bool splits)
    : BatchColumns{},
      scene_(scene),
      materials_(scene.materials),
      passes_(passes),
      is_smooth_((scene.features & GLINT_FEATURE_SMOOTH_NORMALS) || materials_.bends_normals),
      splits_(splits),
      shows_light_(splits || wants(GLINT_PASS_DIFFUSE) || wants(GLINT_PASS_SPECULAR) ||
                   wants(GLINT_PASS_SHADOW)),
      groups_(wants(GLINT_PASS_LIGHT_GROUPS) ? 3 * size_t(scene.light_group_count) : 0),
      given_(groups_.size() / 3) {
  size_t count = groups_.size();
  each_column([&](std::span<double*>, size_t width, bool) { count += width; });
  columns_ = Columns(count);
  passing_columns = materials_.passing_columns;
}

/// each(members, their number of columns, whether these are zeroed) for what is needed.
template <class Each>
void Batch::each_column(Each each) {
#define POINT_COLUMN(name, width, needed, zeroed) \
  if (needed) each(columns_of(name), size_t(width) * size_t(needed), zeroed);
#define CLOSURE_COLUMN POINT_COLUMN
#define SUM_COLUMN(name, pass, needed, beyond) \
  if (needed || wants(pass)) each(columns_of(parts_.name), size_t(3), false);
#include "shading/path_state.inc"
}

void Batch::begin(const Queue& rays) {
  queue = &rays;
  count_ = rays.size();
  if (count_ > columns_.rows() || !t) reserve(count_);
  static_cast<RayColumns&>(*this) = rays;
  each_column([&](std::span<double*> columns, size_t, bool zeroed) {
    for (double* column : columns) std::fill_n(column, zeroed ? count_ : 0, 0.0);
  });
  std::fill(given_.begin(), given_.end(), uint8_t(0));
  sums = parts_;
#define SUM_COLUMN(name, pass, needed, beyond) \
  if (!is_seen() && !(beyond)) std::fill_n(sums.name, 3, nullptr);
#include "shading/path_state.inc"
}

void Batch::clear_group(size_t group) const {
  for (size_t c = 0; c < 3; ++c) std::fill_n(groups_[3 * group + c], count_, 0.0);
  given_[group] = 1;
}

void Batch::reserve(size_t rows) {
  columns_.reserve(rows);
  stride = columns_.rows();
  size_t next = 0;
  const auto place = [&](std::span<double*> columns, size_t width, bool) {
    for (size_t c = 0; c < columns.size(); ++c) columns[c] = columns_[next + c];
    next += width;
  };
  each_column(place);
  place(groups_, groups_.size(), false);
  if (!is_smooth_) std::copy_n(g, 3, n);
  if (!is_smooth_) std::copy_n(x, 3, origin);
#define POINT_NUMBERS(type, name) \
  name##_.resize(stride);         \
  name = name##_.data();
#include "shading/path_state.inc"
}

Surface Batch::surface(size_t k) const {
  Surface s;
  s.instance = instance[k];
  s.primitive = primitive[k];
  s.outside = outside[k] != 0;
  s.weights[1] = weights[0][k];
  s.weights[2] = weights[1][k];
  s.weights[0] = 1 - s.weights[1] - s.weights[2];
  s.x = row(x, k);
  s.g = row(g, k);
  s.n = row(n, k);
  s.offset = offset[k];
  return s;
}

void Batch::set_surface(size_t k, const Surface& s) {
  set_row(x, k, s.x);
  set_row(g, k, s.g);
  offset[k] = s.offset;
  outside[k] = s.outside ? -1 : 0;
  weights[0][k] = s.weights[1];
  weights[1][k] = s.weights[2];
  if (is_smooth_) {
    set_row(n, k, s.n);
    set_row(origin, k, s.x);
    if (behind[0]) set_row(behind, k, s.x);
  }
}

void Batch::find_points(const Stages& stages, uint32_t missed) {
  SurfaceStage stage = this->stage<SurfaceStage>();
  stage.count = count_;
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
  const MaterialTable& all = materials_;
  ShadeStage stage = this->stage<ShadeStage>();
  stage.count = count_;
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
  for (int c = 0; c < 3; ++c) stage.ambient[c] = scene_.world.ambient[c];
  return stage;
}

EvaluateStage Batch::evaluation(const Material& of, double* slots) {
  EvaluateStage stage = this->stage<EvaluateStage>();
  stage.tables = scene_.input_tables();
  stage.lobes = materials_.lobes.data() + of.first_lobe;
  stage.lobe_count = of.lobe_count;
  stage.sums = sums;
  for (int c = 0; c < 3; ++c) stage.ambient[c] = scene_.world.ambient[c];
  if (!of.has(GLINT_TRANSLUCENT)) stage.translucent[0] = nullptr;
  if (!of.goes_below) stage.below[0] = nullptr;
  if (of.program > 0) {
    stage.program = scene_.programs.of(of.program);
    stage.normal = of.normal;
    stage.bump_shadowing = of.bump_shadowing;
    stage.base_normal = of.base_normal;
    stage.kind = is_seen() ? RayKind::kCamera : RayKind::kBounced;
    stage.slots = slots;
  }
  stage.layout = &materials_.rows_of_lobes;
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
  for (const LobeSpan& row : materials_.spans)
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
      set_row(n, k, row(lifted, k));
      bump[k] = lifted_bump[k];
    }
  if (lowering) std::fill_n(lowering, count_, 1.0);
  for (double* const* columns : {g, is_smooth_ ? n : nullptr, unbent})
    for (size_t c = 0; columns && columns[0] && c < 3; ++c)
      for (size_t k = 0; k < count_; ++k) columns[c][k] = -columns[c][k];
  for (size_t c = 0; c < 3; ++c) {
    if (is_smooth_) std::copy_n(behind[c], count_, origin[c]);
    std::copy_n(translucent[c], count_, diffuse[c]);
  }
  clear_specular();
  return true;
}

}  // namespace glint
