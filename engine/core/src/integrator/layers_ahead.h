// Camera rays that go straight on through surface after surface.
#pragma once
#include <vector>

#include "integrator/columns.h"
#include "integrator/queue.h"
#include "scene/scene.h"

namespace glint {

/// The closest hits of camera rays that go straight on, one generation after the other: the same
/// as from Accel::closest, but several layers ahead are found at a time.
class LayersAhead {
 public:
  LayersAhead(const Scene& scene, Scratch& scratch) : scene_(scene), scratch_(scratch) {}

  /// The rays of so many paths set out.
  void begin(size_t paths) {
    paths_ = paths;
    generation_ = 0;
  }
  /// The next hits of a queue's rays, one a path. All later rays of a path continue its first one.
  void closest(const Queue& queue, const Hits& hits);

 private:
  static constexpr size_t kO = 0, kD = 3, kTMin = 6, kTMax = 7, kT = 8, kColumns = 9;
  static constexpr uint32_t kMost = Layers::kMost;

  /// What is known ahead of a path's ray.
  struct Ahead {
    uint8_t next = 0, end = 0;
    bool last = false;  // nothing is behind them
  };

  void list_unknown(const Queue& queue, const Hits& hits);
  bool take_known(uint32_t slot, double t_min, size_t k, const Hits& hits);
  void look_ahead(const Queue& queue, const Hits& hits);
  void keep(const Queue& queue, const Hits& hits);

  const Scene& scene_;
  Scratch& scratch_;
  size_t paths_ = 0;
  int generation_ = 0;
  std::vector<Ahead> ahead_;  // by slot
  std::vector<Hit> hits_;     // by slot, kMost each
  // Of the rays of a queue about which nothing is known:
  std::vector<uint32_t> rows_;
  Columns rays_{kColumns};  // kT: of the nearest solid surface
  std::vector<uint32_t> instance_, primitive_;
  std::vector<float> u_, v_;
  std::vector<Hit> found_;
  std::vector<uint8_t> count_, blocked_;
};

}  // namespace glint
