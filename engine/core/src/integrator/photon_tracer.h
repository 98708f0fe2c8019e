// Photons from lamps through what is specular to what is not.
#pragma once
#include <atomic>
#include <memory>
#include <vector>

#include "integrator/batch.h"
#include "integrator/media.h"
#include "integrator/photon_emission.h"
#include "integrator/photon_map.h"
#include "integrator/scene_queries.h"
#include "integrator/shade.h"
#include "integrator/transmittance.h"
#include "scene/light_program.h"

namespace glint {

/// One thread's. What it finds of a photon depends on that photon alone.
class PhotonTracer {
 public:
  PhotonTracer(const Scene& scene, const RenderPlan& plan, const Stages& stages);
  PhotonTracer(const PhotonTracer&) = delete;
  PhotonTracer& operator=(const PhotonTracer&) = delete;

  /// Adds to `arrived` where the photons [first, last) of a beam light what is matt.
  void trace(const PhotonBeam& beam, uint32_t first, uint32_t last, std::vector<Photon>& arrived);

 private:
  /// What is known of a photon, by its slot.
  struct Way {
    Vec3d from, d;        // on the lamp, and from there
    Vec3d color;          // of the lamp, as much as the photon carries of it
    double choice;        // by which it is mirrored or refracted, in [0, 1)
    double narrowed = 1;  // as shadows have it
    bool passed = true;   // by nothing but what lets light pass straight as well
  };

  void emit(uint32_t first, uint32_t last);
  void follow(Queue& queue, std::vector<Photon>& arrived);
  void find_hits(const Queue& queue);
  void pass_unlinked(const Queue& queue);
  void dim(Queue& queue);
  void shade(const Queue& queue);
  void arrive(const Queue& queue, std::vector<Photon>& arrived);
  bool comes_straight(const Way& way, Vec3d d) const;
  void go_on(const Queue& queue);
  double allowed(const Queue& queue, const Queue& rays, size_t ray) const;
  void turn(Way& way, Path& path, size_t k, bool refracted) const;
  double narrowing(size_t k) const;
  void apply_program(const Queue& queue);

  const Scene& scene_;
  const RenderPlan& plan_;
  const Stages& stages_;
  Scratch scratch_;
  Shader shader_;
  SceneQueries queries_;
  MediaSpans media_;
  LightProgram program_;
  Batch batch_;
  RayCounts counts_;
  const PhotonBeam* beam_ = nullptr;
  Queue now_{kShadow};  // what comes straight from the lamp, and what does not
  Queue later_{kMirror};
  Queue next_{kShadow}, bent_{kMirror};
  Queue straight_, turned_;  // all that leaves the surfaces of a queue
  std::vector<Way> ways_;
  std::vector<double> slots_, ends_, sums_, before_;  // the last two of each slot
  std::vector<uint32_t> row_of_;                      // of the queue, of each slot
  std::vector<uint32_t> asks_;                        // slots whose light's program is to be run
};

/// The photons of a picture; null where nothing throws any.
std::shared_ptr<const PhotonMap> trace_photons(const Scene& scene, const RenderPlan& plan,
                                               const std::atomic<bool>& cancel);

}  // namespace glint
