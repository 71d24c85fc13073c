# %% [markdown] slideshow={"slide_type": "slide"}
# # From a coarse simulation to telemetry
#
# **Can data from a crude simulator, made realistic by two networks, train a detector?** A lecture on Feldman 2020 (arXiv 2008.12082)
#
# ![Simulator, enhanced signal, with noise, and real telemetry](../figures/fig13_combined.png)

# %% [markdown] slideshow={"slide_type": "notes"}
# 15 minutes to the end of the pipeline. Ask first: who has simulated data to train a model, and how did it end? On each question slide, let
# everybody vote, note the votes on the board, and then go on.

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
# ## What does this simulator know?
#
# ![Source and target](../figures/fig02_source_target.png)

# %% [markdown] slideshow={"slide_type": "notes"}
# It knows when something happens, not how. 20 minutes for the enhancer (lessons 02 to 04). Exercise at the board: how large is
# the error of a square wave for a sine?

# %% [markdown] slideshow={"slide_type": "slide"}
# ## The target is noisy. How noisy will the network's output be?
#
# - as noisy as its target
# - a little smoother
# - nearly without noise

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Least squares averages out what cannot be predicted
#
# ![Loss of the enhancer](03_enhancer.ipynb#2)
#
# Noise cannot be predicted: the loss stays above its variance.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## 13.7 million parameters, or one matrix: which is nearer to the truth?
#
# - the network, by far
# - the network, a little
# - both alike
# - the matrix

# %% [markdown] slideshow={"slide_type": "slide"}
# ## One matrix is nearer
#
# ![Errors of the enhancer and of simple methods](04_enhanced_simulation.ipynb#2)
#
# **Always ask for the strong simple baseline.**

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Vote: which four windows are generated?
#
# ![Eight windows of telemetry](05_real_or_generated.ipynb#1|0.85)

# %% [markdown] slideshow={"slide_type": "notes"}
# Count the votes. Three or four right by pure guessing: 24 %. The playground has as many further votes as you like. 25 minutes up to the
# dimensions of noise.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## The answer stands upside down at the foot
#
# ![Eight windows of telemetry, with the answer](05_real_or_generated.ipynb#1)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Noise is what a moving average leaves
#
# ![Telemetry, its moving average, and what remains](../figures/fig08_source_noise.png)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Two networks teach each other
#
# ![One iteration of adversarial training](../figures/fig11_gan_training.png)

# %% [markdown] slideshow={"slide_type": "slide"}
# ## What do these curves prove?
#
# ![Accuracy and loss of the discriminator](../figures/fig12_accuracy_loss.png)

# %% [markdown] slideshow={"slide_type": "notes"}
# That the two are in balance: this discriminator is right about half of the time. Nothing about what it does not look at. The paper
# stops here.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Compile the discriminator, freeze it, compile the stack: what does it learn in Keras 3?
#
# - the same as in Keras 2
# - what its first step taught it
# - nothing

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Nothing, and the loss moves all the same
#
# ![Loss with the classic pattern and with named weights](20_the_frozen_discriminator.ipynb#2)

# %% [markdown] slideshow={"slide_type": "notes"}
# The loss on generated noise moves because the generator learns. Lesson 20 has the loop and the test that would have found it.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Generated noise fills few of 500 dimensions
#
# ![Share of the variance by dimension](09_generator.ipynb#2)

# %% [markdown] slideshow={"slide_type": "notes"}
# 20 minutes: is the noise realistic? Lessons 09 and 13. Why does the discriminator not notice? It looks for the largest answer of each
# filter and knows neither where in the window it was nor the other windows. A judge of single windows could notice: a linear one that sees
# all 500 samples separates both kinds (lesson 10).

# %% [markdown] slideshow={"slide_type": "slide"}
# ## A detector learns the sum. How often is it wrong on real telemetry?
#
# Its threshold is set for 1 % of false alarms.
#
# - about 1 %
# - some 10 %
# - nearly always

# %% [markdown] slideshow={"slide_type": "slide"}
# ## What a glance misses, a detector sees
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
# ## To learn from, or to compare with: which use of a simulator finds more?
#
# A satellite's battery: fault windows found, thresholds set for 1 %.
#
# - detectors that learned real orbits
# - detectors that learned generated windows
# - telemetry compared with the coarse run
# - telemetry compared with the enhanced run

# %% [markdown] slideshow={"slide_type": "slide"}
# ## A simulator is worth more as a reference than as a source
#
# | battery, gentle regime, five faults | found | false alarms |
# |---|---|---|
# | telemetry compared with the enhanced run | 70.0 % | 0.35 % |
# | telemetry compared with the coarse run | 38.5 % | 1.25 % |
# | detectors that learned real orbits | 13.5 % | 1.69 % |
# | detectors that learned generated windows | 10.9 % | 0.93 % |
#
# The difference between telemetry and a run of the same commands shows a fault.

# %% [markdown] slideshow={"slide_type": "notes"}
# The numbers are those of the battery study, mean over five faults at five severities. The planned current is known exactly there. If it is
# not, it is worse.

# %% [markdown] slideshow={"slide_type": "slide"}
# ## Does the paper hold?
#
# - C1 The network learns the waveform
# - C3 The enhanced signal is too clean
# - C4 The GAN needs about 1,000 iterations
# - C6 The generated noise is similar
# - C8 Detectors trained on it are robust
# - C9 It is right in degraded modes
#
# **Similar by which measure, and sufficient for what?**

# %% [markdown] slideshow={"slide_type": "notes"}
# 10 minutes. Vote claim by claim, then open the report: it has the verdicts with their limits, over several seeds and ways of rounding.
# What should "reproduced" mean if another seed or processor changes the verdict?
