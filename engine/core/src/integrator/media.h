// Where rays are inside of media, and what these let through (semantics/media.md).
#pragma once
#include <vector>

#include "integrator/plan.h"
#include "integrator/waiting_rays.h"
#include "scene/scene.h"
#include "shading/stages.h"

namespace glint {

/// The media on the way of some rays, beyond what they meet too: of each enclosure, where a ray
/// goes out further on more often than in.
class MediaSpans {
 public:
  MediaSpans(const Scene& scene, Scratch& scratch);

  /// Of rays from where they begin to look on; ends do not matter.
  void find(const Rays& rays, RayCounts& counts);
  /// After it, what the media that vary are up to `ends`, which the rest is asked for then: their
  /// programs run once in each of the cells that they are cut to. All pixels share where these
  /// begin. kind: of the rays. Beyond what next to nothing gets through, rays are not followed;
  /// to_end: they are.
  void march(const Rays& rays, const double* ends, uint32_t sample, RayKind kind, RayCounts& counts,
             bool to_end = false);
  /// Makes `depth` fast for many places of a ray, after `march`; the same bits.
  void sum_depths();
  /// The optical depth of ray k from one place to another one. passed_sets: of a light's shadow
  /// rays, see GlintLight. catchers_alone: of what catchers of shadows enclose, and the world.
  Vec3d depth(size_t k, double from, double to, uint64_t passed_sets = 0,
              bool catchers_alone = false) const;
  /// Whether nothing is on the way of any ray.
  bool empty() const { return spans_.empty() && !world(); }
  /// How much goes straight on between them.
  Vec3d passed(size_t k, double from, double to, uint64_t passed_sets = 0,
               bool catchers_alone = false) const;

  /// What lies along a part of a ray.
  struct Piece {
    double from, to;
    Vec3d extinction, scattering, emission;
  };
  /// Of ray k, between two places. emits: the light group whose media alone give light, null for
  /// all.
  void list_pieces(size_t k, double from, double to, std::vector<Piece>& pieces,
                   const int* emits = nullptr) const;
  /// Whether anything between two places of ray k scatters light, on more than what rounding leaves
  /// of a medium behind its end. origin: the largest coordinate of the ray's.
  bool scatters(size_t k, double from, double to, double origin) const;
  /// `to`, or for an endless ray where next to nothing is seen of what scatters any more.
  double reach(size_t k, double from, double to) const;
  /// How much light from the unit direction l is scattered at t of ray k, against its unit
  /// direction d, a unit of length and steradian. excluded_sets: of the light, see GlintLight.
  Vec3d scattering(size_t k, double t, Vec3d d, Vec3d l, uint64_t excluded_sets) const;

 private:
  static constexpr size_t kAtOnce = 128;  // rays

  struct Crossing {
    uint32_t ray, enclosure;
    double t;
    int step;  // 1 where the ray goes in, -1 where out, 0 where both at once
  };
  struct Span {
    uint32_t enclosure;
    double from, to;
    uint32_t first_cell = 0, cells = 0;
  };
  /// A part of a span of a medium that varies, from the end of the one before on.
  struct Cell {
    double from, to, at;  // at: where the program runs
    uint32_t medium, instance;
    Matter matter;
    Vec3d before{};  // the optical depth of the span's cells before it, once summed
  };
  /// A place where a program is to run.
  struct Asked {
    uint32_t ray, cell;
  };
  /// A ray whose cells are not all asked: those left, places in `order_`, and how thick the others
  /// are.
  struct Going {
    uint32_t ray, next, end;
    Vec3d depth;
  };

  void find_crossings(const Rays& rays, RayCounts& counts);
  void take_layers(const Rays& rays, uint32_t ray, const Hit* hits, size_t count, bool more);
  void take_coinciding(const Rays& rays, uint32_t ray, double from, double to);
  void take(const Rays& rays, uint32_t ray, const Hit* hits, size_t count);
  bool enters(const Rays& rays, uint32_t ray, const Hit& hit) const;
  size_t merge(size_t first, size_t& end);
  void add_spans(const Rays& rays, size_t first, size_t end);
  void add_span(const Rays& rays, uint32_t ray, uint32_t enclosure, double from, double to);
  size_t first_span(size_t k) const { return k > 0 ? end_[k - 1] : 0; }
  const Medium& medium_of(const Span& span) const {
    return scene_.media[scene_.media.enclosures[span.enclosure].medium];
  }
  const Medium* world() const {
    return scene_.media.world >= 0 ? &scene_.media[size_t(scene_.media.world)] : nullptr;
  }
  /// The world's medium of ray k, as a span.
  Span everywhere(size_t k) const;
  Vec3d depth_of(const Medium& medium, const Span& span, double from, double to) const;
  const Matter* matter_at(const Medium& medium, const Span& span, double t) const;
  void add_breaks(const Medium& medium, const Span& span, double from, double to) const;
  void cut(const Rays& rays, uint32_t ray, const double* ends, double shift, double coarse);
  void cut_evenly(Span& span, double from, double to, double step, double shift);
  void cut_growing(Span& span, double from, double to, double step, double shift, double coarse);
  void add_cells(double from, double to);
  void end_span(Span& span, const Medium& medium, uint32_t instance);
  void ask_in_turn(const Rays& rays, RayKind kind, bool to_end, RayCounts& counts);
  bool is_dark(Going& going, uint32_t asked);
  void run(const Medium& medium, const std::vector<Asked>& asked, const Rays& rays, RayKind kind);
  Matter matter_of(const Medium& medium, size_t i) const;

  const Scene& scene_;
  const Stages& stages_;
  Scratch& scratch_;
  std::vector<uint8_t> opacities_;  // of enclosures: all are met, and none stops a ray
  Opacity opacity_{};
  WaitingRays waiting_;
  std::vector<Hit> hits_, coinciding_;
  std::vector<uint8_t> taken_;  // of enclosures: those of which all hits at one distance are known
  std::vector<Crossing> crossings_;
  std::vector<Span> spans_;
  std::vector<uint32_t> end_;  // of each ray's spans
  // Of media that vary: cells, the spans of the world's, what each medium is asked, and the columns
  // of its program.
  std::vector<Cell> cells_;
  std::vector<Span> everywhere_;
  std::vector<std::vector<Asked>> asked_;
  std::vector<Going> going_;
  std::vector<uint32_t> order_;  // of cells along each ray
  std::vector<double> slots_;
  bool summed_ = false;  // the optical depths before cells
  mutable std::vector<double> breaks_;
};

}  // namespace glint
