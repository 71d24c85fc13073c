# %% [markdown] slideshow={"slide_type": "slide"}
# <style>
# .reveal .slides section { text-align: left; }
# .reveal h1, .reveal h2 { text-transform: none; font-size: 46px; margin: 0 0 0.4em; color: #1a1a1a; }
# .reveal p, .reveal li, .reveal td, .reveal th { font-size: 30px; line-height: 1.4; }
# .reveal img { display: block; margin: 0 auto; width: 100%; height: 490px; object-fit: contain; border: 0; box-shadow: none; }
# .reveal table { margin: 0 0 0.8em; } .reveal .jp-InputPrompt, .reveal .jp-Collapser { display: none; }
# </style>
#
# # From a coarse simulation to telemetry
#
# **Can data from a crude simulator, made realistic by two networks, train a detector?** A lecture on Feldman 2020 (arXiv 2008.12082)
#
# ![Simulator, enhanced signal, with noise, and real telemetry](../figures/fig13_combined.png)

# %% [markdown] slideshow={"slide_type": "notes"}
# 15 minutes to the end of the pipeline. Ask first: who has simulated data to train a model, and how did it end?

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Nobody breaks a satellite to record its faults
#
# - A detector learns from *nominal* telemetry and raises an alarm on what is unlike it.
# - It must be tested on faults, and faults are rare.
# - So both are simulated. But a simulation is **too clean**: real noise then looks like a fault.
#
# The paper's repair: keep the simulator crude and fast, and learn the rest.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## One network makes the waveform, another makes the noise
#
# ![The pipeline of the paper](../figures/fig01_pipeline.png)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## A square wave knows when, not how
#
# ![Source and target](../figures/fig02_source_target.png)

# %% [markdown] slideshow={"slide_type": "notes"}
# 20 minutes for the enhancer (lessons 02 to 04). Exercise at the board: how large is the error of a square wave for a sine?

# %% [markdown] slideshow={"slide_type": "slide"}
# ## A noisy target teaches a clean waveform
#
# ![Loss of the enhancer](03_enhancer.ipynb#2)
#
# Noise cannot be predicted: the loss stays above its variance.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## One matrix does it better than 13.7 million parameters
#
# ![Errors of the enhancer and of simple methods](04_enhanced_simulation.ipynb#2)
#
# **Always ask for the strong simple baseline.**

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Vote: which four windows are generated?
#
# ![Eight windows of telemetry](05_real_or_generated.ipynb#1)

# %% [markdown] slideshow={"slide_type": "notes"}
# Count the votes. Three or four right by pure guessing: 24 %. The answer is printed upside down at the foot of the picture. 25 minutes for
# the next five slides.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Noise is what a moving average leaves
#
# ![Telemetry, its moving average, and what remains](../figures/fig08_source_noise.png)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Two networks teach each other
#
# ![One iteration of adversarial training](../figures/fig11_gan_training.png)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## The curves say: in balance
#
# ![Accuracy and loss of the discriminator](../figures/fig12_accuracy_loss.png)
#
# The paper stops here. What does this balance prove?

# %% [markdown] slideshow={"slide_type": "slide"}
# ## A pitfall: on the left, the discriminator never learns
#
# ![Loss with the classic pattern and with named weights](20_the_frozen_discriminator.ipynb#2)
#
# Keras 3: `compile`, freeze, `compile` trains nothing. The loss moves all the same.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Generated noise fills few of 500 dimensions
#
# ![Share of the variance by dimension](09_generator.ipynb#2)
#
# Effective rank: 32 generated, 372 real.

# %% [markdown] slideshow={"slide_type": "notes"}
# 20 minutes: is the noise realistic? Lessons 09, 13 and 21. Why does the discriminator not notice? It judges one window at a time.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## What no eye sees, a detector does
#
# ![False alarms by training data](13_combined.ipynb#2)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## The noise must have the right size, to a few per cent
#
# ![False alarms over the scale of the training noise](22_false_alarms.ipynb#2)
#
# The right size is not enough: noise of another kind sets another threshold.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Faults that it never saw come out wrong
#
# ![A nominal, a stuck and a drifting window](23_degraded_modes.ipynb#1)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## A simulator is worth more as a reference than as a source
#
# | a satellite's battery, gentle regime | fault windows found | false alarms |
# |---|---|---|
# | telemetry compared with the enhanced run | 70.0 % | 0.35 % |
# | telemetry compared with the coarse run | 38.5 % | 1.25 % |
# | detectors that learned real orbits | 13.5 % | 1.69 % |
# | detectors that learned generated windows | 10.9 % | 0.93 % |
#
# The difference between telemetry and a run of the same commands shows a fault.

# %% [markdown] slideshow={"slide_type": "notes"}
# The numbers are those of the battery study. The planned current is known exactly there. If they are not, it is worse.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Does the paper hold? At best in part
#
# | claim | seed 0 |
# |---|---|
# | C1 The network learns the waveform | reproduced |
# | C3 The enhanced signal is too clean | reproduced |
# | C4 The GAN needs about 1,000 iterations | not reproduced |
# | C6 The generated noise is similar | not reproduced |
# | C8 Detectors trained on it are robust | does not hold |
# | C9 It is right in degraded modes | does not hold |
#
# **Similar by which measure, and sufficient for what?**

# %% [markdown] slideshow={"slide_type": "notes"}
# 10 minutes. C2, C5 and C7 are in the report. What should "reproduced" mean if another seed or processor changes the verdict?
