"""What every package uses: errors, files, console, stages, parallel work, TensorFlow and training.
It depends on no other package.
"""
