// Light that reaches surfaces straight from the lights (notes 4.12-4.16), and by its points what
// else is asked of them.
#pragma once
#include "integrator/onward.h"
#include "integrator/scattered_light.h"
#include "integrator/shared_light.h"

namespace glint {

/// What drawn rays meet of a mesh light: light groups, emitters, and where.
struct EmitterHits {
  Columns distance{1};
  std::vector<int> group;
  std::vector<uint32_t> emitter, placement;
  std::vector<float> u, v;

  void reserve(size_t rows);
};

class DirectLight : LightContext {
 public:
  explicit DirectLight(const LightContext& context);

  /// Adds all lights to the points of `batch`, for pixel sample `sample`.
  void illuminate(Batch& batch, uint32_t sample) {
    illuminate(batch, sample, batch.queue->past.caught == Queue::Past::kAlone);
  }
  /// The same as if catchers of shadows were the only things there.
  void illuminate_catchers(Batch& batch, uint32_t sample) { illuminate(batch, sample, true); }
  /// Whether lamps are so many that they share the shadow rays of a sample.
  bool shares() const { return lamps_.on(); }

  // These are of the points that `illuminate` was told last.
  LitBatch lit;
  OnwardRays onward;
  ScatteredLight scattered;

 private:
  void illuminate(Batch& batch, uint32_t sample, bool alone);
  bool find_few(const Batch& batch);
  template <class Body>
  void each_share(Batch& batch, Body body);
  void add_lights(Batch& batch, uint32_t sample);
  template <class Takes>
  void add_lights(Batch& batch, uint32_t sample, Takes takes);
  void add_light(const Batch& batch, const Light& light, const int64_t* mask, uint32_t sample,
                 size_t number);
  void add_drawn(const Batch& batch, const Light& light, const LampSample& lamp);
  size_t find_emitters(const Light& light, const LampSample& lamp, size_t count, bool matt);
  uint32_t parts_of(const Batch& batch, const Light& light) const;
  void find_cut(const Batch& batch, const Light& light, const int64_t* mask) const;
  void note_hidden(size_t count, uint32_t parts);
  void add_rest(const Batch& batch, const Light& light, const int64_t* mask, uint32_t sample,
                uint32_t parts);

  SharedLight lamps_, glow_;  // glow_: of media
  bool some_few_ = false,     // some points take few samples: those of `few_`
      takes_few_ = false;     // they alone are lit now
  std::vector<uint8_t> few_;
  std::vector<int64_t> whole_;    // the batch's mask of points that lights may reach
  std::vector<int64_t> linked_;   // that of a light that lights but some
  std::vector<int32_t> balance_;  // of the batch's points: directions of a dome open less hidden
  Columns sky_{3};                // the rest of a dome
  EmitterHits emitters_;
};

}  // namespace glint
