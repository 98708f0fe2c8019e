// What is known of the rays of one queue while they are shaded, by component: hits, points, what
// they add to the film, what lights need.
#pragma once
#include <vector>

#include "film/passes.h"
#include "integrator/columns.h"
#include "integrator/queue.h"
#include "scene/scene.h"
#include "scene/surface.h"

namespace glint {

class FirstHitCache;

class Batch : public BatchColumns {
 public:
  /// `passes`: the parts to keep for camera rays; all that others bring is Mirror. splits: light is
  /// told apart by kinds of surface.
  Batch(const Scene& scene, Passes passes, bool splits);
  Batch(const Batch&) = delete;
  Batch& operator=(const Batch&) = delete;

  /// Makes room for the queue's rays; what was known of others is gone. The queue is to stay as it
  /// is while the batch is used.
  void begin(const Queue& rays);
  size_t size() const { return count_; }

  Hits hits() { return {t, instance, primitive, u, v, fallbacks ? retries : nullptr}; }
  Hit hit(size_t k) const { return {t[k], instance[k], primitive[k], u[k], v[k]}; }
  bool missed(size_t k) const { return instance[k] == Hit::kNone; }
  Surface surface(size_t k) const;
  void set_surface(size_t k, const Surface& s);
  /// A stage over the batch, of which nothing else is said yet.
  template <class Stage>
  Stage stage() const {
    Stage stage{};
    static_cast<BatchColumns&>(stage) = *this;
    return stage;
  }
  /// The points of the rays' hits. missed: the material of rays that hit nothing.
  void find_points(const Stages& stages, uint32_t missed);
  /// How the points are shaded whose materials do not vary.
  ShadeStage shading();
  /// How points of a material that varies are evaluated, but for which they are. slots: room for
  /// those of its program.
  EvaluateStage evaluation(const Material& material, double* slots);
  /// What the points' instances say of light that grazes them, where the scene has such.
  void set_offsets();
  /// Rows of `specular` that are highlights of microfacets.
  int highlights() const { return scene_.materials.highlights(queue->gathers()); }
  /// The column of a row of `specular`.
  double* lobe_row(int kind, int number) const {
    return specular + size_t(scene_.materials.rows_of_lobes.row(kind, number)) * stride;
  }
  /// Highlights show nothing.
  void clear_specular();
  /// The points become those of their other sides, where TRANSLUCENT lobes are DIFFUSE ones and all
  /// there is. False where none has any, and nothing has changed.
  bool turn_round();

  /// Adds to Combined, and to a part (of `sums`) where it is kept.
  void add(size_t k, double* const (&part)[3], Vec3d c) {
    add_to(sums.total, k, c);
    add_to(part, k, c);
  }
  static void add_to(double* const (&columns)[3], size_t k, Vec3d c) {
    if (columns[0]) {
      columns[0][k] += c.x;
      columns[1][k] += c.y;
      columns[2][k] += c.z;
    }
  }
  /// Counts a ray for the pixel of ray k.
  void charge(size_t k) const {
    if (cost) cost[queue->slot(k)] += 1;
  }
  /// The same of all rays.
  void charge() const {
    for (size_t k = 0; cost && k < count_; ++k) charge(k);
  }
  /// Notes what of a soft light point k has met: Refinement::SoftLight.
  void mark_soft_light(size_t k, uint8_t met) const { soft_light[queue->slot(k)] |= met; }
  /// Notes that a rough surface gives back that much of what its ray meets.
  void mark_thrown(uint32_t slot, Vec3d given) const {
    if (thrown) thrown[slot] = std::max(thrown[slot], max_abs(given));
  }
  bool is_on_strand(size_t k) const {
    const auto& all = scene_.instances;
    return all.has_strands && all.geometry(all.group(instance[k])).kind == GLINT_STRANDS;
  }
  /// Whether light is told apart by groups of lights.
  bool has_groups() const { return !groups_.empty(); }
  size_t group_count() const { return given_.size(); }
  /// Whether a group gives anything to these rays; else its columns hold anything.
  bool gives(size_t group) const { return given_[group]; }
  /// The three columns of a group's light, of which Combined has all of it.
  double* const* group(size_t group) const { return &groups_[3 * group]; }
  /// The same, to be added to.
  double* const* opened_group(size_t group) const {
    if (!given_[group]) clear_group(group);
    return this->group(group);
  }
  /// Adds to a group's; to none where it is -1, or nobody asks.
  void add_to_group(int group, size_t k, Vec3d c) const {
    if (size_t(group) >= given_.size() || !any(c)) return;
    double* const* const columns = opened_group(size_t(group));
    for (int i = 0; i < 3; ++i) columns[i][k] += c[i];
  }
  /// Whether lights' light is told apart there.
  bool splits() const { return splits_ && is_seen(); }
  /// Adds what `hits` counted of float tests that could not decide.
  void charge_fallbacks() const {
    for (size_t k = 0; fallbacks && k < count_; ++k) fallbacks[queue->slot(k)] += retries[k];
  }
  /// Coefficient of the lobe number `lobe` of those that send rays on from point k.
  Vec3d passing_term(size_t k, int lobe) const {
    const double* column = passing + size_t(passing_columns) * size_t(lobe) * stride + k;
    return {column[0], column[stride], column[2 * stride]};
  }

  /// Its normal; `other` where it has none of its own.
  Vec3d passing_normal(size_t k, int lobe, Vec3d other) const {
    if (passing_columns != PassingTerm::kTurned) return other;
    const size_t first = size_t(passing_columns) * size_t(lobe) + PassingTerm::kNormal;
    const double* const own = passing + first * stride + k;
    const Vec3d m{own[0], own[stride], own[2 * stride]};
    return any(m) ? m : other;
  }

  /// Its index of refraction, and its exponent; `own` where the scene has none of a program.
  double passing_ior(size_t k, int lobe, double own) const {
    return passing_number(k, lobe, PassingTerm::kIor, own);
  }
  double passing_exponent(size_t k, int lobe, double own) const {
    return passing_number(k, lobe, PassingTerm::kExponent, own);
  }

  const Queue* queue = nullptr;
  SumColumns sums{};  // parts that are not kept are null
  double
      *cost = nullptr,
      *fallbacks =
          nullptr;  // rays traced for each slot, and float64 tests of them; null when nobody asks
  double* thrown = nullptr;  // as Paths has it; null where nobody asks
  uint8_t* soft_light =
      nullptr;  // of each path, as Refinement has it of slots; null when nobody asks
  FirstHitCache* first_hits =
      nullptr;  // what is known of these rays, from its row `first_row` on; null for none
  size_t first_row = 0;

 private:
  double passing_number(size_t k, int lobe, int column, double own) const {
    if (passing_columns == PassingTerm::kPlain) return own;
    return passing[size_t(passing_columns * lobe + column) * stride + k];
  }
  void reserve(size_t rows);
  void clear_group(size_t group) const;
  template <class Each>
  void each_column(Each each);
  bool is_seen() const { return queue && queue->visibility == kCamera; }
  bool wants(int pass) const { return passes_ >> pass & 1; }
  /// Whether it is known where light was made.
  bool tells_apart() const { return splits_ || has_groups(); }

  const Scene& scene_;
  const MaterialTable& materials_;
  const Passes passes_;
  const bool is_smooth_, splits_, shows_light_;
  size_t count_ = 0;
  Columns columns_;
#define POINT_NUMBERS(type, name) std::vector<type> name##_;
#include "shading/path_state.inc"
  SumColumns parts_{};
  std::vector<double*> groups_;  // three for each light group, none where nobody asks
  mutable std::vector<uint8_t> given_;
};

}  // namespace glint
