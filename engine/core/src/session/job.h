// A render at work on threads of its own: trees, then waves of samples, with progress, cancel and a
// picture after each wave.
#pragma once
#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "film/film.h"
#include "integrator/plan.h"
#include "integrator/tracer.h"
#include "scene/scene.h"
#include "system/thread_pool.h"

namespace glint {

/// What is wrong with the settings for this scene; empty when they are sound.
std::string settings_problems(const GlintRenderSettings& settings, const Scene& scene);

class Job {
 public:
  /// The settings have no problems. Starts at once.
  Job(Scene& scene, const GlintRenderSettings& settings);
  ~Job();

  GlintProgress wait(uint32_t milliseconds);
  void resume();
  /// The scene of the next sample; what is wrong with it, or empty.
  std::string move(Scene& scene, const GlintRenderSettings& settings);
  void cancel();
  /// As Film has it, of the last complete wave. Throws std::bad_alloc.
  std::shared_ptr<ZeroedBuffer<float>> picture(int pass, uint64_t size);
  GlintStats stats();
  const std::string& error() const { return error_; }

 private:
  /// As `beyond_`, where all samples are one wave and nothing tells before.
  static constexpr double kBeyondAtOnce = 2;
  void work();
  void run();
  uint32_t first_wave();
  bool at_once();
  void trace_waves();
  void make_tracers(FirstHitCache* first_hits);
  void drop_tracers();
  void trace_moments(uint32_t first, uint32_t last);
  bool wait_for_scene();
  void ask_for_scene();
  void trace_tiles(size_t thread, uint32_t first, uint32_t last, std::atomic<size_t>& next);
  void trace_tile(Tracer& tracer, const Tile& tile, uint32_t first, uint32_t last);
  void resolve(uint32_t samples);
  bool has_beyond() const;
  void expect_beyond(uint32_t samples, double sample_seconds, double seconds);
  void refine(uint32_t samples);
  void end_wave(uint32_t samples, double seconds);
  void publish(uint32_t samples, std::unique_lock<std::mutex>& lock);
  template <class Body>
  void on_all_threads(Body body);
  template <class Body>
  void on_all_tiles(Body body);
  void enter(int state);
  void fail(const char* what);
  bool ended() const { return state_ >= GLINT_DONE; }
  double fraction() const;  // with the mutex
  Scene* scene_;            // of the sample that is traced
  RenderPlan plan_;
  Film film_;
  std::atomic<bool> cancel_{false};
  std::atomic<uint64_t> done_{0};                 // tiles times samples
  std::atomic<uint64_t> seen_{0};                 // tiles whose camera rays beyond those are traced
  double expected_ = 0;                           // as beyond_, of the wave that ends
  std::unique_ptr<ThreadPool> pool_;              // while waves are traced, and
  std::vector<std::unique_ptr<Tracer>> tracers_;  // one for each of its threads

  std::mutex mutex_;  // guards what follows, and the film's pictures
  std::condition_variable changed_, resumed_;
  int state_ = GLINT_PREPARING;
  bool built_ = false;  // the scene's trees are there to stay
  uint32_t samples_ = 0, reported_ = 0, resumed_after_ = 0;
  double trace_seconds_ = 0, moving_seconds_ = 0;  // moving: until later samples' scenes stood
  bool moved_ = false;                             // the next sample's scene is there
  RayCounts rays_, earlier_rays_;                  // earlier: of tracers that are gone
  double beyond_;  // so many samples take as long as the camera rays beyond them
  std::string error_;

  std::thread thread_;
};

}  // namespace glint
